"""Practising to drive, on the operator's computer alone: the real window, client and drive core, no robot.

Nothing here opens a connection: commands, states and pictures pass from one object to another, by way of a
network that can be made bad (`practice.network`). `tests/architecture` keeps it so.
"""
