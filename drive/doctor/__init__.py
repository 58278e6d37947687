"""Finds out what keeps this robot from being driven, and what stops it."""
