"""Encoders: the catalogue, the trials that prove them, and the selection."""
