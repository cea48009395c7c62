"""How is `winding run` configured, wound and delivered?"""
