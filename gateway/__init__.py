"""The robot's side of the door: ROS 2 in, gRPC out."""
