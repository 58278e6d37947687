"""The demo of the fleet: robots, hub, store and console on this machine, watched or checked step by step."""
