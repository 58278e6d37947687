"""The robot's computer, sampled from psutil and the files under /sys and /proc."""
