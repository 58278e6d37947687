"""A simulated robot: real rclpy publishers at realistic rates, with faults on demand."""
