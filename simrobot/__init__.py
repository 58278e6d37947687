"""A simulated robot for development, tests and demos, with faults on request."""
