"""The servers of a test are ended, whatever becomes of one of them."""

import subprocess
from pathlib import Path
from typing import Any

import pytest

from tests.support.nats_servers import NatsServers


class _Process:
    """Stands in for a server; `slow` if its end takes too long."""

    def __init__(self, *, slow: bool = False) -> None:
        self._slow = slow
        self.killed = False

    def send_signal(self, number: int) -> None:
        """What else it is sent changes nothing."""

    def kill(self) -> None:
        self.killed = True

    def wait(self, within_s: float) -> int:
        if self._slow:
            raise subprocess.TimeoutExpired("nats-server", within_s)
        return -9


def test_one_that_does_not_end_in_time_leaves_no_other_running(tmp_path: Path) -> None:
    servers, nodes = NatsServers(tmp_path, 3), [_Process(slow=True), _Process(), _Process()]
    processes: Any = nodes
    servers.processes = processes
    with pytest.raises(subprocess.TimeoutExpired):
        servers.close()
    assert all(each.killed for each in nodes)
