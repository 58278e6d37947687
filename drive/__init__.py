"""Moves the robot on behalf of an operator: hold to run, and stop on any doubt."""
