"""Tests that take many minutes, and run on request alone: `scripts/test FILE --on-request`."""

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    """`--on-request`: also what is marked so."""
    parser.addoption("--on-request", action="store_true", help="also run tests that take many minutes")


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skips what was not asked for; here, so that all of it makes one line of the summary."""
    if item.get_closest_marker("on_request") and not item.config.getoption("--on-request"):
        pytest.skip("takes many minutes. Type: scripts/test FILE --on-request")
