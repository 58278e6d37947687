"""Hardware encoders that this machine doesn't have, by their real names, and able to fail."""
