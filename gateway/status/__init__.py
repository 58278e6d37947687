"""The status and what follows from it. Pure: no ROS, no gRPC, no protobuf, no clock."""
