"""Segments of a recording as MCAP files: writing, recovery, and the index of rosbag2 beside them."""
