"""The hub's requests over a real connection: carried out once where allowed, recorded, answered."""

from pathlib import Path
from typing import Any

from omniseer.bridge.v1 import bridge_service_pb2 as bridge_pb
from tests.support.eventually import eventually
from tests.support.fleet_robot import BOTH, FleetRobot, fleet_robot

DONE, REFUSED = bridge_pb.REQUEST_OUTCOME_DONE, bridge_pb.REQUEST_OUTCOME_REFUSED
FAILED = bridge_pb.REQUEST_OUTCOME_FAILED


async def answers(robot: FleetRobot, count: int) -> dict[str, Any]:
    """The first answer to each request, when there are so many."""

    async def now() -> dict[str, Any]:
        return {each.request_id: each for each in reversed(robot.bridge.answers)}

    return await eventually(now, lambda found: len(found) >= count, f"{count} answers")


async def test_requests_are_carried_out_once_and_recorded(tmp_path: Path) -> None:
    audit = tmp_path / "audit.jsonl"
    security = {"audit": {"file": audit}}
    async with fleet_robot(tmp_path, allowed=BOTH, security=security) as robot:
        robot.recorder.add({"a": b"1"}, id="one")
        robot.bridge.forgets = True
        robot.bridge.request("u", upload={"recording_id": "one"})
        robot.bridge.request("s", snapshot={"pre_s": 5, "label": "from the hub"})
        found = await answers(robot, 2)
        assert (found["u"].outcome, found["u"].recording_id) == (DONE, "one")
        assert found["s"].outcome == DONE
        snapshot = robot.recorder.recordings[found["s"].recording_id]
        assert (snapshot.label, snapshot.trigger) == ("from the hub", "fleet: anna")

        async def repeated() -> int:
            return len(robot.bridge.answers)

        # It answers again a bridge that goes on asking, and does nothing more.
        await eventually(repeated, lambda count: count >= 5, "repeated answers")
        assert [method for method, _, _ in robot.bridge.calls] == ["upload"]
        assert robot.bridge.calls[0][2]["x-caller"] == "fleet: anna"
        assert len(robot.recorder.requests) == 1
        event = await robot.event("control_action")
        action = event.control_action
        assert (action.who, action.address, action.method) == ("fleet: anna", "hub", "UploadRecording")
    lines = audit.read_text(encoding="utf-8")
    assert lines.count('"who": "fleet: anna"') == 2
    assert "TriggerSnapshot" in lines


async def test_what_is_not_allowed_or_can_not_be_done_is_answered_so(tmp_path: Path) -> None:
    async with fleet_robot(tmp_path, allowed=("snapshot",)) as robot:
        robot.bridge.request("upload", upload={"recording_id": "one"})
        robot.bridge.request("unknown")
        robot.bridge.request("late", remaining_ms=0, snapshot={})
        robot.bridge.request("invalid", snapshot={"pre_s": 99_999})
        found = await answers(robot, 4)
        assert {each.outcome for each in found.values()} == {REFUSED}
        robot.recorder.has_ring = False
        robot.bridge.request("no ring", snapshot={})
        assert (await answers(robot, 5))["no ring"].outcome == FAILED
        assert not robot.bridge.calls
        event = await robot.event("control_action")
        assert "does not allow it" in event.control_action.answer


async def test_nothing_is_allowed_by_default(tmp_path: Path) -> None:
    async with fleet_robot(tmp_path) as robot:
        robot.bridge.request("u", upload={"recording_id": "one"})
        robot.bridge.request("s", snapshot={})
        found = await answers(robot, 2)
        assert {each.outcome for each in found.values()} == {REFUSED}
        assert not robot.bridge.calls
        assert not robot.recorder.requests
