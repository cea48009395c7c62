"""What does the driver know without a network: mapping, values, samples, link and heartbeats?"""
