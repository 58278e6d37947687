"""How pytest-xdist spreads the tests over its workers: a file stays together, the longest files go first.

All that run containers are one unit, because they share a deployment.
"""

from typing import Any

import pytest
from xdist.scheduler import LoadScopeScheduling

_CONTAINERS = "tests/e2e/containers/"
_LONG = ("tests/e2e/", "tests/integration/fuzz/", "tests/integration/monitor/")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Puts the longest files first, so that no worker begins one when the others are done."""
    items.sort(key=lambda item: (not item.nodeid.startswith(_CONTAINERS), not item.nodeid.startswith(_LONG)))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> LoadScopeScheduling:
    """Returns the scheduler that keeps the units below together."""
    return _ByFile(config, log)


class _ByFile(LoadScopeScheduling):  # type: ignore[misc]  # xdist has no types
    def _split_scope(self, nodeid: str) -> str:
        return _CONTAINERS if nodeid.startswith(_CONTAINERS) else nodeid.partition("::")[0]
