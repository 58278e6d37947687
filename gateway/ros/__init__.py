"""From ROS 2 to the board: the only package of the gateway that imports rclpy."""

from common.ros_environment import check_middleware

# Here, because importing rclpy ends the process when the environment names a middleware that is not there.
check_middleware()
