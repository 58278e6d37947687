"""Fixtures that every test may use; each plugin says what it offers."""

import signal

pytest_plugins = ["tests.support.engine", "tests.support.ros"]


def pytest_configure() -> None:
    """A run in the background inherits an ignored SIGINT and would pass it on to the programs under test."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
