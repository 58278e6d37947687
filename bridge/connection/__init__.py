"""The robot's connection to its fleet: its state, and the loops between outbox and hub."""
