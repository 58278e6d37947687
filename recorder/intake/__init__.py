"""From ROS 2 to samples: the only package of the recorder that imports rclpy."""

from common.ros_environment import check_middleware

# Importing rclpy ends the process if the environment names a middleware that is not installed.
check_middleware()
