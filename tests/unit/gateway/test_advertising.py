"""The process that announces the gateway: bounded, started again, and gone with its task."""

import asyncio
import logging
import re
from pathlib import Path

import pytest

from common.advertisement import Advertisement
from gateway.platform import advertising
from gateway.platform.advertiser import service
from gateway.platform.hosts import advertised_addresses
from tests.support.virtual_time import in_virtual_time
from tests.support.waiting import wait_until

WITHIN_S = 30.0
ANY = "0.0.0.0"  # noqa: S104  # compared
LAB = Advertisement("lab", "omniseer.gateway.v1", True)


def stand_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: str) -> str:
    """A module that is run in place of the advertiser."""
    (tmp_path / "stand_in.py").write_text(code)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    return "stand_in"


async def test_a_failure_is_in_the_log_and_the_next_attempt_follows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(advertising, "_FIRST_PAUSE_S", 0.01)
    code = f"import sys; open({str(tmp_path / 'runs')!r}, 'a').write('x'); sys.exit('no network')"
    module = stand_in(tmp_path, monkeypatch, code)
    with caplog.at_level(logging.WARNING):
        task = asyncio.create_task(advertising.advertise(LAB, 1, "127.0.0.1", (), module))
        runs = tmp_path / "runs"
        await asyncio.to_thread(
            wait_until, lambda: runs.exists() and len(runs.read_text()) > 1, "it runs again", WITHIN_S
        )
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
    assert re.search(r"not advertised on the network: no network; next attempt in 0.01 s", caplog.text)


async def test_its_process_ends_with_the_task_even_if_it_hangs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(advertising, "_STOPS_WITHIN_S", 0.1)
    up = tmp_path / "up"
    code = f"import signal, time; signal.signal(15, signal.SIG_IGN); open({str(up)!r}, 'w'); time.sleep(600)"
    task = asyncio.create_task(
        advertising.advertise(LAB, 1, "127.0.0.1", (), stand_in(tmp_path, monkeypatch, code))
    )
    await asyncio.to_thread(wait_until, up.exists, "it runs", WITHIN_S)
    task.cancel()
    # A process that is left behind fails the whole module.
    with pytest.raises(asyncio.CancelledError):
        await task


class HeldProcess:
    """A process that the kernel holds, as in a read of a disk that hangs: no signal ends it."""

    pid = 4242
    returncode = None

    def __init__(self) -> None:
        self.stderr = asyncio.StreamReader()
        self.signals: list[str] = []

    def terminate(self) -> None:
        self.signals.append("terminate")

    def kill(self) -> None:
        self.signals.append("kill")

    async def wait(self) -> None:
        await asyncio.get_running_loop().create_future()


@in_virtual_time
async def test_a_process_that_a_kill_does_not_end_holds_up_no_end_of_the_gateway(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    started: asyncio.Future[HeldProcess] = asyncio.get_running_loop().create_future()

    async def start(*_: str, **__: int) -> HeldProcess:
        started.set_result(HeldProcess())
        return started.result()

    monkeypatch.setattr(asyncio, "create_subprocess_exec", start)
    task = asyncio.create_task(advertising.advertise(LAB, 1, "127.0.0.1", ()))
    process = await started
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
    assert process.signals == ["terminate", "kill"]
    assert "the process 4242 that advertises the gateway was killed" in caplog.text


@pytest.mark.parametrize("name", ["lab", "lab ü.x\n", "x" * 300, "...", ""])
def test_any_name_makes_a_valid_label(name: str) -> None:
    records = service(Advertisement(name, "c", False), 50051, ("10.0.0.7",))
    label = records.name.removesuffix("._robot-gateway._tcp.local.")
    assert re.fullmatch(r"[A-Za-z0-9-]{1,40}", label)
    assert records.parsed_addresses() == ["10.0.0.7"]


def test_the_announced_addresses_are_those_that_operators_can_call() -> None:
    assert advertised_addresses("10.0.0.7", ()) == ("10.0.0.7",)
    assert advertised_addresses(ANY, ("10.0.0.7",)) == ("10.0.0.7",)
    assert not any(each.startswith("127.") for each in advertised_addresses(ANY, ()))
