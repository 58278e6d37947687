"""Receives recordings: signs URLs for robots, reads again what they have sent, and signs receipts for it."""
