"""Fixtures that every test may use; each plugin says what it offers."""

pytest_plugins = ["tests.support.engine", "tests.support.ros"]
