"""The robot's connection to its fleet.

Its state, the loops between outbox and hub, and the uploads as both see them.
"""
