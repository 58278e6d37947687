"""Recorder service: messages and video of the robot in MCAP files, and the disk that they are kept on."""
