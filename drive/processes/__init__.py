"""The two processes: the worker that moves the robot, and the guard that watches it."""
