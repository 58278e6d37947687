"""The demo: four programs on this machine, watched by a person or checked step by step."""
