"""State of the robot's computer, sampled with psutil and from files in /sys and /proc."""
