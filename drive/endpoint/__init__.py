"""The socket between the gateway and the drive program, and its schema."""
