"""From ROS 2 to the board: the only package of the gateway that imports rclpy."""

from common.ros_environment import check_middleware

# Importing rclpy ends the process if the environment names a middleware that is not installed.
check_middleware()
