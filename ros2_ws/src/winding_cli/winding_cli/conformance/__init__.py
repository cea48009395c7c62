"""Does a machine's driver keep the contract?"""
