"""From ROS 2 to the board: the only package of the gateway that imports rclpy."""
