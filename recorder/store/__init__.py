"""The folders of all recordings: what is where, what goes first, what may be written."""
