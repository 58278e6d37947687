"""The robot in its ROS 2 graph: the base and its velocities, other sources of them, its stop and its lock."""
