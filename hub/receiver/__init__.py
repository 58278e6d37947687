"""Receives recordings: signs URLs for robots, reads what they have sent again, and confirms it by receipts."""
