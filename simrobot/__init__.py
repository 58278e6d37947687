"""A simulated robot: real ROS 2 publishers at realistic rates, with faults on demand."""
