"""The fault rules, one module per part of the robot, and the tracker of raised and cleared faults."""
