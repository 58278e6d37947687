"""What keeps this machine from being a robot's gateway: looked at from beside it, whether it runs or not."""
