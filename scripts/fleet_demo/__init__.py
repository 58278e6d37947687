"""The fleet's demo: robots, hub, store and console on this machine, watched by a person or checked step by step."""
