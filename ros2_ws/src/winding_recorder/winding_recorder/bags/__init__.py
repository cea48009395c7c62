"""Recordings: write, describe, check, recover, play, replay and export rosbag2 folders."""
