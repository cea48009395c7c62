"""How are a study and an identification conducted, and what do they print?"""
