"""`robotctl events --json` at a real gateway: the documented keys, whole and in order, over its restart."""

import json
import signal
import subprocess
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from omniseer.gateway.v1.robot_gateway_pb2 import SetPreviewModeRequest
from tests.support.free import free_tcp_port
from tests.support.gateway_program import GatewayProgram, gateway_program
from tests.support.preview_double import double_process
from tests.support.robotctl import ENDS_WITHIN_S, ROBOTCTL, environment, robotctl
from tests.support.robotctl_docs import documented, holds, leaves


@pytest.fixture
def ground(tmp_path: Path) -> Iterator[Path]:
    """A preview service that follows its requests."""
    with double_process(tmp_path / "preview.sock"):
        yield tmp_path


def switch(gateway: GatewayProgram, on: bool) -> None:
    gateway.stub.SetPreviewMode(SetPreviewModeRequest(enabled=on), timeout=5)


def position(document: Mapping[str, Any], kind: str = "event") -> tuple[str, int]:
    at = document[kind]["position"]
    return at["run_id"], at["sequence"]


def events(target: str, *words: str) -> list[dict[str, Any]]:
    done = robotctl("--target", target, "--json", "events", *words)
    assert (done.returncode, done.stderr) == (0, "")
    return [json.loads(line) for line in done.stdout.splitlines()]


def first_with(lines: Iterator[dict[str, Any]], part: str, kind: str | None = None) -> dict[str, Any]:
    """The next line with this; the test's own time limit ends a wait for one that never comes."""
    return next(line for line in lines if line[part] and kind in (None, line[part].get("kind")))


def test_since_resumes_exactly_after_its_position(ground: Path) -> None:
    with gateway_program(ground, sources=[]) as gateway:
        target = f"127.0.0.1:{gateway.port}"
        switch(gateway, True)
        switch(gateway, False)
        printed = events(target)
        for document in printed:
            holds(documented("events --json"), document, complete=False)
            assert [part for part, value in document.items() if value is not None] == ["event"]
        run_id, first = position(printed[0])
        count = len(printed)
        assert [position(each) for each in printed] == [(run_id, first + more) for more in range(count)]
        assert {each["event"]["kind"] for each in printed} >= {"control", "preview"}
        # More may have happened meanwhile.
        later = events(target, "--since", f"{run_id}:{first + 1}")
        assert later[: len(printed) - 2] == printed[2:]
        last = position(printed[-1])[1]
        assert all(position(each)[1] > last for each in events(target, "--since", f"{run_id}:{last}"))


def test_follow_prints_events_an_outage_and_the_gap_behind_it(ground: Path) -> None:
    said, port = documented("events --json"), free_tcp_port()
    command = [str(ROBOTCTL), "--target", f"127.0.0.1:{port}", "--json", "events", "--follow"]
    with gateway_program(ground, port, sources=[]) as gateway:
        following = subprocess.Popen(command, env=environment(), stdout=subprocess.PIPE, text=True)
        try:
            assert following.stdout
            lines = map(json.loads, following.stdout)
            switch(gateway, True)
            running = first_with(lines, "event", "preview")
            gateway.process.kill()
            outage = first_with(lines, "error")
            with gateway_program(ground, port, sources=[]) as again:
                gap = first_with(lines, "gap")
                switch(again, False)
                control = first_with(lines, "event", "control")
                following.send_signal(signal.SIGINT)
                following.communicate(timeout=ENDS_WITHIN_S)
        finally:
            following.kill()
            following.communicate()
    assert following.returncode == 0
    for document in (running, outage, gap, control):
        holds(said, document, complete=False)
    for part, document in (("error", outage), ("gap", gap)):
        inner = {key for key in said if key.startswith(f"{part}.")} - {"gap.position"}
        assert inner <= leaves(document).keys(), "documented keys that don't come"
    assert outage["error"]["kind"] == "unreachable"
    assert gap["gap"]["reason"] == "new-run"
    assert position(running)[0] != position(gap, "gap")[0] == position(control)[0]
    assert position(control)[1] > position(gap, "gap")[1]
