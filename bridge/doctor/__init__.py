"""Finds out what keeps this robot from its fleet."""
