"""What is in a rosbag2 folder: written, checked, recovered, exported?"""
