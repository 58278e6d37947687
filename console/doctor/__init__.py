"""Finds faults between this computer and the robot, from name resolution up to the video stream."""
