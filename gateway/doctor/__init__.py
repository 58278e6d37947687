"""Checks of the gateway's machine: configuration, credentials, endpoints, devices and ROS sources."""
