"""Evidence that the numbers are right: verification, experiments, studies, fault campaign.

Nothing of the product imports this package; its commands appear where it is installed.
"""
