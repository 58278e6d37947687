"""Copies recordings to the fleet's store: queue, gates, and one upload at a time."""
