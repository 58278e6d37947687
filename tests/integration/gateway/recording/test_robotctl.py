"""robotctl record against a whole gateway: what a user types, reads and gets as exit code."""

import asyncio
import json
from pathlib import Path
from typing import Any

from console.client import GatewayClient
from tests.support.gateway_double import GatewayDouble, serving
from tests.support.recorder_double import RecorderDouble
from tests.support.recording_gateway import RecordingRobot, recording_robot
from tests.support.robotctl import only_line, robotctl, robotctl_process
from tests.support.running_gateway import running_gateway


async def typed(robot: RecordingRobot, *words: str) -> Any:
    return await asyncio.to_thread(robotctl, "--target", f"127.0.0.1:{robot.port}", "record", *words)


async def printed(robot: RecordingRobot, *words: str) -> Any:
    ran = await typed(robot, *words, "--json")
    assert ran.returncode == 0, ran.stderr
    return json.loads(ran.stdout)


async def test_a_day_of_recording(tmp_path: Path) -> None:
    async with recording_robot(tmp_path) as robot:
        started = await printed(robot, "start", "--label", "lap 1", "--no-video", "--max-size", "5")
        recording_id = started["recording"]["id"]
        request, _ = robot.recorder.requests[-1]
        assert (request.with_video, request.max_bytes) == (False, 5_000_000)
        again = await typed(robot, "start")
        assert (again.returncode, again.stdout) == (1, "")
        assert only_line(again.stderr).endswith(
            f"Wait until it ends, or type: robotctl --target 127.0.0.1:{robot.port} record stop"
        )
        robot.recorder.write(b"messages", final=True)
        assert (await typed(robot, "stop")).returncode == 0
        assert (await printed(robot, "snapshot", "--before", "5"))["recording"]["kind"] == "snapshot"
        listed = await typed(robot, "list")
        assert "lap 1" in listed.stdout
        assert "IDLE" in listed.stdout
        shown = await typed(robot, "show", recording_id)
        assert "metadata.yaml" in shown.stdout
        assert (await typed(robot, "pin", recording_id)).returncode == 0
        refused = await typed(robot, "delete", recording_id)
        assert "it is pinned" in only_line(refused.stderr)
        assert (await typed(robot, "unpin", recording_id)).returncode == 0
        assert (await typed(robot, "delete", recording_id)).returncode == 0
        missing = await typed(robot, "show", recording_id)
        assert missing.returncode == 1
        assert "there is no recording" in only_line(missing.stderr)


async def test_export_and_its_refusals(tmp_path: Path) -> None:
    double = RecorderDouble()
    double.add({"metadata.yaml": b"rosbag2", "data/000000.mcap": bytes(10**6)}, id="one")
    async with recording_robot(tmp_path, double) as robot:
        to = tmp_path / "copies"
        done = await typed(robot, "export", "one", "--to", str(to))
        assert done.stdout.split(": ", 1)[1] == "2 files, 1.0 MB, verified\n", done.stderr
        assert (to / "one/data/000000.mcap").read_bytes() == bytes(10**6)
        again = await typed(robot, "export", "one", "--to", str(to))
        assert again.returncode == 1
        assert "--resume" in only_line(again.stderr)
        resumed = await printed(robot, "export", "one", "--to", str(to), "--resume")
        assert resumed["received"] == 0
        (to / "one/data/000000.mcap").write_bytes(b"other")
        other = await typed(robot, "export", "one", "--to", str(to), "--resume")
        assert other.returncode == 1
        assert "with other content than the robot's" in only_line(other.stderr)
        read_only = await typed(robot, "export", "one", "--to", "/proc")
        assert read_only.returncode == 1
        assert "can't be written" in only_line(read_only.stderr)


async def test_what_could_not_be_counted_is_shown_and_never_as_nothing_lost(tmp_path: Path) -> None:
    double = RecorderDouble()
    one = double.add({"a": b"1"}, id="one", gap_count=2, uncounted_gaps=1)
    async with recording_robot(tmp_path, double) as robot:
        text = (await typed(robot, "show", "one")).stdout
        assert "losses unknown, 1 gap of unknown size" in text
        assert "2 gaps (1 of unknown size)" in text
        one.messages_lost = 5
        assert "5 lost, 1 gap of unknown size" in (await typed(robot, "show", "one")).stdout
        shown = await printed(robot, "show", "one")
        assert (shown["messages_lost"], shown["uncounted_gaps"]) == (5, 1)


async def test_a_recording_of_several_pages_is_shown_and_exported_whole(tmp_path: Path) -> None:
    double = RecorderDouble()
    files = {f"data/{number:06}.mcap": bytes([number]) * 100 for number in range(7)}
    double.add(files, id="one")
    double.files_of_page = 3
    to = tmp_path / "to"
    async with recording_robot(tmp_path, double) as robot:
        shown = await printed(robot, "show", "one")
        assert [each["name"] for each in shown["files"]] == list(files)
        assert (await printed(robot, "export", "one", "--to", str(to)))["files"] == 7
        assert {name: (to / "one" / name).read_bytes() for name in files} == files


async def test_a_robot_that_lists_a_part_of_the_files_exports_nothing_as_if_it_were_all(
    tmp_path: Path,
) -> None:
    double = RecorderDouble()
    double.add({f"data/{number:06}.mcap": b"1" for number in range(7)}, id="one")
    double.files_of_page, double.has_pages = 3, False
    async with recording_robot(tmp_path, double) as robot:
        for words in (["show", "one"], ["export", "one", "--to", str(tmp_path / "to")]):
            ran = await typed(robot, *words)
            assert ran.returncode == 1
            assert "lists only 3 of the 7 files of one" in only_line(ran.stderr)
        assert not (tmp_path / "to").exists()


async def test_the_installed_program_and_the_status(tmp_path: Path) -> None:
    async with recording_robot(tmp_path) as robot:
        await robot.start(label="lap")
        robot.recorder.report.status.elapsed_ms, robot.recorder.report.status.room_s = 61_000, 3600
        robot.recorder.changed()
        target = f"127.0.0.1:{robot.port}"
        listed = await asyncio.to_thread(robotctl_process, "--target", target, "record", "list", "--json")
        assert json.loads(listed.stdout)["status"]["state"] == "recording"
        status = await asyncio.to_thread(robotctl, "--target", target, "status")
        assert "RECORDING  lap, 1 min 01 s, 0 B, without video, room for 1 h 00 min" in status.stdout


async def test_the_robot_is_asked_once(tmp_path: Path) -> None:
    double = RecorderDouble()
    double.add({"a": b"1"}, id="one")
    async with recording_robot(tmp_path, double) as robot:
        await printed(robot, "list")
        assert double.looks == ["ListRecordings"]
        await printed(robot, "export", "one", "--to", str(tmp_path / "to"))
        assert double.looks == ["ListRecordings", "GetRecording"]


def test_a_gateway_from_before_recording_is_named_with_what_to_type() -> None:
    with serving(GatewayDouble()) as port:
        for words in (["list"], ["start"], ["stop"], ["export", "one"], ["delete", "one"]):
            ran = robotctl("--target", f"127.0.0.1:{port}", "record", *words)
            assert (ran.returncode, ran.stdout) == (1, "")
            assert only_line(ran.stderr) == (
                f"error: the gateway at 127.0.0.1:{port} is too old to record; nothing was changed. "
                "Update it on the robot (docs/deploy.md); to see its version, type: "
                f"robotctl --target 127.0.0.1:{port} info"
            )


async def test_a_robot_that_is_not_set_up(tmp_path: Path) -> None:
    async with running_gateway(tmp_path / "preview.sock") as operator:
        target = f"127.0.0.1:{operator.port}"
        ran = await asyncio.to_thread(robotctl, "--target", target, "record", "list")
        assert ran.returncode == 1
        assert "not set up for recording" in only_line(ran.stderr)


async def test_the_blocking_library(tmp_path: Path) -> None:
    double = RecorderDouble()
    double.add({"a": b"1"}, id="one")

    def use(port: int) -> list[str]:
        with GatewayClient(f"127.0.0.1:{port}") as robot:
            assert robot.export_recording("one", tmp_path / "to").files == 1
            return [each.id for each in robot.recordings()]

    async with recording_robot(tmp_path, double) as robot:
        assert await asyncio.to_thread(use, robot.port) == ["one"]
