"""The fleet, as its hub knows it: read from the hub alone, never from a robot."""
