"""Recordings: rosbag2 folders written, checked, recovered, played and replayed."""
