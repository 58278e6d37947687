"""Finds out what keeps this robot from recording."""
