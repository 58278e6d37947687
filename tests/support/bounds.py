"""Nothing hangs a run, and what fails is named at once.

pytest-timeout raises in the test, once, and not at all after a failure. What waits for ever then, in a
fixture's end, an event loop that is being closed or a foreign library, is beyond its reach: GRACE_S later
the process prints where each of its threads is, and ends. pytest-xdist reports its test as failed, and goes
on with another worker (see distribution.py).
"""

import faulthandler
import os
from collections.abc import Iterator
from typing import TextIO

import pytest

GRACE_S = 60.0
"""From a test's timeout, or its failure, to the end of its process."""
_STDERR = pytest.StashKey[TextIO]()


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Bounds a test with its fixtures."""
    mark = item.get_closest_marker("timeout")
    limit_s = float(mark.args[0] if mark else item.config.getini("timeout"))
    # Between the phases of a test nothing is captured: this is the run's own standard error.
    with os.fdopen(os.dup(2), "w") as stderr:
        item.stash[_STDERR] = stderr
        faulthandler.dump_traceback_later(limit_s + GRACE_S, exit=True, file=stderr)
        try:
            return (yield)
        finally:
            faulthandler.cancel_dump_traceback_later()


@pytest.hookimpl(trylast=True)
def pytest_exception_interact(node: pytest.Item | pytest.Collector) -> None:
    """Bounds what follows a failure: pytest and pytest-timeout end their bounds here, for debuggers."""
    if stderr := node.stash.get(_STDERR, None):
        faulthandler.dump_traceback_later(GRACE_S, exit=True, file=stderr)


class _NamesFailures:
    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Names a failure before the summary does, which a run that is ended from outside never prints."""
        if report.failed:
            print(f"\nFAILED {report.nodeid} ({report.when}, {report.duration:.1f} s)", flush=True)


def pytest_configure(config: pytest.Config) -> None:
    """Names failures where all reports arrive: not in a worker."""
    if not hasattr(config, "workerinput"):
        config.pluginmanager.register(_NamesFailures())
