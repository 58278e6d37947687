"""Driving by operators: who has the lease, and what of their commands goes to the drive program."""
