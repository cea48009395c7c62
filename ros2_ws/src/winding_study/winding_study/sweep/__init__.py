"""What comes out of many runs: what varies, who winds, one table?"""
