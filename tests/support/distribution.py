"""How pytest-xdist spreads the tests over its workers: a file stays together, the longest files go first.

Files that share the containers of `_shared_demo` (tests/e2e/containers/conftest.py) are one unit.
"""

from typing import Any, Final

import pytest
from xdist.scheduler import LoadScopeScheduling

_SHARING: Final = tuple(
    f"tests/e2e/containers/test_{name}.py" for name in ("main_job", "hardening", "upgrade", "faults")
)
_LONGEST: Final = (
    "tests/e2e/test_demo.py",
    *_SHARING,
    *(f"tests/e2e/containers/test_{name}.py" for name in ("guarded", "on_the_robot", "bad_ground")),
    *(f"tests/integration/preview/test_{name}.py" for name in ("listener", "encrypted", "sources")),
    "tests/integration/console/test_client.py",
    "tests/integration/viewer/test_session.py",
    "tests/integration/gateway/test_hostile_callers.py",
    *(f"tests/integration/viewer/test_{name}.py" for name in ("window", "decoders", "command")),
    "tests/e2e/test_install_console.py",
    *(
        f"tests/integration/ros/test_{name}.py"
        for name in ("told_to_operators", "freshness", "no_harm", "rates")
    ),
    *(f"tests/integration/preview/test_{name}.py" for name in ("program", "fallback", "service")),
    "tests/integration/access/test_takes_effect.py",
    "tests/integration/monitor/test_with_a_robot.py",
    "tests/integration/fuzz/test_fuzz.py",
)
"""Files of more than 20 s, the longest first: one that a worker began late would leave the others idle."""
_RANKS: Final = {file: rank for rank, file in enumerate(_LONGEST)}


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Puts the longest files first."""
    items.sort(key=lambda item: _RANKS.get(_file_of(item.nodeid), len(_RANKS)))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> LoadScopeScheduling:
    """Returns the scheduler that keeps the units below together."""
    return _ByFile(config, log)


class _ByFile(LoadScopeScheduling):  # type: ignore[misc]  # xdist has no types
    def _split_scope(self, nodeid: str) -> str:
        file = _file_of(nodeid)
        return _SHARING[0] if file in _SHARING else file


def _file_of(nodeid: str) -> str:
    return nodeid.partition("::")[0]
