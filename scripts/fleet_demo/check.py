"""The fleet's main job, once: one line per step with the measured time."""

import asyncio
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from common.errors import UserError
from fleet.names import EVENTS
from fleet_demo.parts import NODES, ROBOTS, FleetGround, start_receiver, start_robot
from hub import administration
from simrobot.control import ask

_UP_WITHIN_S: Final = 150.0
_SEEN_WITHIN_S: Final = 60.0
_VERIFIED_WITHIN_S: Final = 90.0
_REVOKED_WITHIN_S: Final = 5.0
"""docs/fleet.md."""
_FAULT: Final = "odometry"
_AFFECTED: Final = "lab2"
_RECORDING: Final = "lab1"
_REVOKED: Final = "lab3"


def check(ground: FleetGround, hub_s: float) -> None:
    """Raises UserError at the first step that fails; the step's line says so."""
    print(f"ok   {hub_s:6.2f} s  hub: {NODES} nodes of nats-server with TLS, a store", flush=True)
    with _step("robots", ground) as say:
        start_receiver(ground)
        for robot in ROBOTS:
            start_robot(ground, robot)
        rows = ground.programs.wait_until(lambda: _if_all_up(ground), "all robots are ready", _UP_WITHIN_S)
        ages = ", ".join(f"{name} seen {row['last_seen_ms']} ms ago" for name, row in rows.items())
        say(f"{len(rows)} enrolled and up; {ages}")
    with _step("event", ground) as say:
        ask(ground.control_socket(_AFFECTED), {"silent": [_FAULT]})
        say(_seen_once(ground, "fault-raised"))
    with _step("node killed", ground) as say:
        say(_node_killed(ground))
    with _step("snapshot", ground) as say:
        answer = ground.robotctl("command", _RECORDING, "snapshot", "--before", "5", "--after", "0")
        recording_id = answer["recording_id"]
        say(f"{_RECORDING}: {answer['message']} ({recording_id})")
    with _step("upload", ground) as say:
        say(_uploaded(ground, recording_id))
    with _step("get", ground) as say:
        say(_copied(ground, recording_id))
    with _step("revoke", ground) as say:
        say(_revoked(ground))
    with _step("stop", ground) as say:
        ground.programs.stop()
        say("all programs ended in good order")


@contextmanager
def _step(name: str, ground: FleetGround) -> Iterator[Callable[[str], None]]:
    began_s = time.monotonic()
    seen: list[str] = []
    try:
        yield seen.append
        ground.programs.check_alive()
    except (UserError, AssertionError) as error:
        standings = ", ".join(f"{robot} {_standing(row)}" for robot, row in ground.rows().items())
        print(f"FAIL {time.monotonic() - began_s:6.2f} s  {name}: {error}; {standings}", flush=True)
        raise
    print(f"ok   {time.monotonic() - began_s:6.2f} s  {name}: {'; '.join(seen)}", flush=True)


def _standing(row: dict[str, Any]) -> str:
    return f"{row['standing']} ({row['state']['summary'] if row['state'] else row['problem']})"


def _if_all_up(ground: FleetGround) -> dict[str, dict[str, Any]] | None:
    rows = ground.rows()
    ready = [row["robot"] for row in rows.values() if row["standing"] == "up" and row["state"]["ready"]]
    return rows if sorted(ready) == sorted(ROBOTS) else None


def _seen_once(ground: FleetGround, kind: str) -> str:
    """Waits for the fault's event in the hub, and fails if it is there twice."""
    began_s = time.monotonic()
    found = ground.programs.wait_until(
        lambda: _fault_events(ground, kind), f"the hub has the event {kind}", _SEEN_WITHIN_S
    )
    took_s = time.monotonic() - began_s
    if len(found) != 1:
        raise UserError(f"the event {kind} is in the hub {len(found)} times")
    return f"{_AFFECTED}: '{found[0]['message']}' is in the hub once, after {took_s:.1f} s"


def _fault_events(ground: FleetGround, kind: str) -> list[dict[str, Any]]:
    items = [item["event"] for item in ground.events() if item["event"]]
    return [
        item["event"]
        for item in items
        if item["robot"] == _AFFECTED
        and item["event"]["kind"] == kind
        and item["event"]["fault"]["id"].startswith(_FAULT)
    ]


def _node_killed(ground: FleetGround) -> str:
    servers = ground.hub.servers
    leader = servers.leader(EVENTS)
    if leader is None:
        raise UserError("no node leads the stream of events")
    servers.kill(leader)
    ask(ground.control_socket(_AFFECTED), {"silent": []})
    seen = _seen_once(ground, "fault-cleared")
    servers.start_all()
    return f"node {leader}, which led the events, killed and started again; {seen}"


def _uploaded(ground: FleetGround, recording_id: str) -> str:
    # The snapshot may not have ended: then the robot refuses, and is asked again.
    def requested() -> bool:
        try:
            ground.robotctl("command", _RECORDING, "upload", recording_id)
        except UserError:
            return False
        return True

    ground.programs.wait_until(requested, "the robot takes the request for the upload", _SEEN_WITHIN_S)

    def verified() -> dict[str, Any] | None:
        found = ground.robotctl("recordings", _RECORDING)["recordings"]
        return next((each for each in found if each["receipt"] == "verified"), None)

    stored = ground.programs.wait_until(verified, "the recording is verified", _VERIFIED_WITHIN_S)
    return (
        f"{len(stored['files'])} files, {stored['recording']['size']} bytes, verified at {stored['location']}"
    )


def _copied(ground: FleetGround, recording_id: str) -> str:
    """Copies the recording from the store, without asking the robot, and compares it with the robot's."""
    to = ground.directory / "laptop"
    answer = ground.robotctl("get", _RECORDING, recording_id, "--to", str(to))
    folder = Path(answer["folder"])
    copied = {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    own = ground.directory / _RECORDING / "recordings"
    for name, content in copied.items():
        if not any(path.read_bytes() == content for path in own.rglob(name.name) if path.is_file()):
            raise UserError(f"{name} on this computer is not the robot's file")
    return f"{answer['files']} files, {answer['size']} bytes, from the store; each is as the robot has it"


def _revoked(ground: FleetGround) -> str:
    wait_until = ground.programs.wait_until
    wait_until(lambda: _is_connected(ground), "the robot is connected", _SEEN_WITHIN_S)
    began_s = time.monotonic()
    asyncio.run(administration.revoke(ground.hub.directory, "robot", _REVOKED))
    left_s = _REVOKED_WITHIN_S - (time.monotonic() - began_s)
    wait_until(lambda: not _is_connected(ground), f"out in {_REVOKED_WITHIN_S:g} s of its revocation", left_s)
    took_s = time.monotonic() - began_s
    wait_until(lambda: _is_shown_as_revoked(ground), "the table says so", _SEEN_WITHIN_S)
    return f"{_REVOKED} is revoked, its connection ended after {took_s:.1f} s, and the table says so"


def _is_connected(ground: FleetGround) -> bool:
    servers = ground.hub.servers
    connections = [each for node in range(NODES) for each in servers.monitor(node, "connz")["connections"]]
    return any(each.get("name") == f"robot-bridge {_REVOKED}" for each in connections)


def _is_shown_as_revoked(ground: FleetGround) -> bool:
    row = ground.rows().get(_REVOKED)
    return row is not None and row["standing"] == "revoked"
