"""Connections of operators and strangers: who keeps one, and how much it may do."""
