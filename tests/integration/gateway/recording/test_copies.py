"""Copies to this computer, over connections that break: resumed, verified, and never outside their folder."""

import asyncio
import resource
from collections.abc import Callable
from pathlib import Path

import pytest

from common.errors import UserError
from console.client import AsyncGatewayClient, ExportOptions, ExportProgress, GatewayError, Refused
from console.client.errors import GatewayFailed, Unreachable
from console.client.exporting import ExportedRecording
from omniseer.gateway.v1 import recording_pb2 as pb
from tests.support.bad_links import Relay
from tests.support.eventually import eventually
from tests.support.recorder_double import CHUNK_BYTES, RecorderDouble, sha256
from tests.support.recording_gateway import RecordingRobot, reaches, recording_robot

FILE = "data/000000.mcap"
METADATA = b"rosbag2_bagfile_information: {}\n"
DATA = bytes(range(256)) * 1024 * 16 + b"end"
"""16 chunks and a bit."""
LONG = DATA * 8
"""More than may be on its way, of which a client holds 64 chunks."""


def robot_with(**files: bytes) -> RecorderDouble:
    double = RecorderDouble()
    double.add(files or {FILE: DATA, "metadata.yaml": METADATA}, id="one")
    return double


async def copied(port: int, folder: Path, options: ExportOptions | None = None) -> ExportedRecording:
    async with AsyncGatewayClient(f"127.0.0.1:{port}") as client:
        return await client.export_recording("one", folder / "one", options)


def partly(double: RecorderDouble, after: int) -> Callable[[ExportProgress], None]:
    """Has the recorder rest once so many bytes have arrived; the test then acts, and lets it go on."""
    rested = False

    def progress(now: ExportProgress) -> None:
        nonlocal rested
        # Only once: what had arrived by then comes here while the test acts.
        if now.done >= after and not rested:
            rested = True
            double.flowing.clear()

    return progress


async def rests(double: RecorderDouble) -> None:
    async def flowing() -> bool:
        return double.flowing.is_set()

    await eventually(flowing, lambda flows: not flows, "enough has arrived")


async def test_a_whole_recording_arrives_in_its_own_layout(tmp_path: Path) -> None:
    seen: list[ExportProgress] = []
    async with recording_robot(tmp_path, robot_with()) as robot:
        done = await copied(robot.port, tmp_path / "to", ExportOptions(progress=seen.append))
    folder = tmp_path / "to/one"
    assert (folder / FILE).read_bytes() == DATA
    assert (folder / "metadata.yaml").read_bytes() == METADATA
    assert (done.files, done.size, done.cuts) == (2, len(DATA) + len(METADATA), 0)
    assert done.received == done.size
    assert seen[-1].done == seen[-1].total == done.size
    assert not list(folder.rglob("*.part"))


async def test_a_cut_connection_costs_less_than_a_chunk(tmp_path: Path) -> None:
    double = robot_with(**{FILE: LONG})
    async with recording_robot(tmp_path, double) as robot:
        with Relay(robot.port) as relay:
            options = ExportOptions(progress=partly(double, 5 * CHUNK_BYTES))
            copying = asyncio.create_task(copied(relay.port, tmp_path / "to", options))
            await rests(double)
            relay.cut()
            double.flowing.set()
            done = await asyncio.wait_for(copying, 30)
    assert (tmp_path / "to/one" / FILE).read_bytes() == LONG
    assert done.cuts == 1
    assert done.received - done.size <= CHUNK_BYTES
    (first, began), (second, offset), *_ = double.exports
    assert (first, began, second) == (FILE, 0, FILE)
    assert offset >= 5 * CHUNK_BYTES, "it went on behind what had arrived"


async def test_cancelled_it_leaves_a_part_and_another_export_goes_on_from_there(tmp_path: Path) -> None:
    double, to = robot_with(**{FILE: LONG}), tmp_path / "to"
    async with recording_robot(tmp_path, double) as robot:
        options = ExportOptions(progress=partly(double, 3 * CHUNK_BYTES))
        copying = asyncio.create_task(copied(robot.port, to, options))
        await rests(double)
        copying.cancel()
        with pytest.raises(asyncio.CancelledError):
            await copying
        double.flowing.set()
        part = to / "one" / f"{FILE}.part"
        left = part.stat().st_size
        assert left >= 3 * CHUNK_BYTES
        with pytest.raises(UserError, match="is there already"):
            await copied(robot.port, to, ExportOptions(resume=False))
        done = await copied(robot.port, to)
    assert double.exports[1] == (FILE, left)
    assert done.received == done.size - left
    assert (to / "one" / FILE).read_bytes() == LONG
    assert not part.exists()


async def test_a_part_that_is_damaged_on_this_disk_is_fetched_again(tmp_path: Path) -> None:
    double, folder = robot_with(), tmp_path / "to/one"
    (folder / "data").mkdir(parents=True)
    (folder / f"{FILE}.part").write_bytes(bytes(CHUNK_BYTES))
    async with recording_robot(tmp_path, double) as robot:
        await copied(robot.port, tmp_path / "to")
    assert [offset for file, offset in double.exports if file == FILE] == [CHUNK_BYTES, 0]
    assert (folder / FILE).read_bytes() == DATA


async def test_a_disk_that_takes_only_a_part_ends_the_export_and_another_goes_on(tmp_path: Path) -> None:
    # As a disk becomes full, the largest size of a file cuts the last write short.
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    async with recording_robot(tmp_path, robot_with()) as robot:
        resource.setrlimit(resource.RLIMIT_FSIZE, (len(DATA) - 1, before[1]))
        try:
            with pytest.raises(UserError, match="can't be written"):
                await copied(robot.port, tmp_path / "to")
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)
        assert not (tmp_path / "to/one" / FILE).exists()
        await copied(robot.port, tmp_path / "to")
    assert (tmp_path / "to/one" / FILE).read_bytes() == DATA


async def test_chunks_that_arrive_damaged_are_fetched_again(tmp_path: Path) -> None:
    double = robot_with()
    double.wrong_crcs = 2
    async with recording_robot(tmp_path, double) as robot:
        done = await copied(robot.port, tmp_path / "to")
    assert done.cuts == 1
    assert (tmp_path / "to/one" / FILE).read_bytes() == DATA


async def test_a_whole_that_is_not_what_the_robot_says_is_not_kept(tmp_path: Path) -> None:
    double = robot_with()
    double.wrong_digest = True
    async with recording_robot(tmp_path, double) as robot:
        with pytest.raises(GatewayFailed, match="another SHA-256"):
            await copied(robot.port, tmp_path / "to")
    assert not [path for path in (tmp_path / "to").rglob("*") if path.is_file()]


async def test_a_file_that_changes_ends_the_export_and_says_so(tmp_path: Path) -> None:
    double = robot_with(**{FILE: LONG})
    async with recording_robot(tmp_path, double) as robot:
        with Relay(robot.port) as relay:
            options = ExportOptions(progress=partly(double, CHUNK_BYTES))
            copying = asyncio.create_task(copied(relay.port, tmp_path / "to", options))
            await rests(double)
            double.files["one"][FILE] = DATA[::-1]
            relay.cut()
            double.flowing.set()
            with pytest.raises(Refused) as caught:
                await asyncio.wait_for(copying, 30)
    assert caught.value.reason == "RECORDING_CHANGED"


async def test_a_running_recording_gives_what_is_final(tmp_path: Path) -> None:
    async with recording_robot(tmp_path) as robot:
        recording = await robot.start()
        robot.recorder.write(b"final", final=True)
        robot.recorder.write(b"still written", final=False)
        async with AsyncGatewayClient(f"127.0.0.1:{robot.port}") as client:
            done = await client.export_recording(recording.id, tmp_path / "to")
            assert (done.files, done.not_final) == (1, ("data/000001.mcap",))
            robot.recorder.end()
            done = await client.export_recording(recording.id, tmp_path / "to")
    assert (done.files, done.not_final) == (3, ())
    assert (tmp_path / "to/data/000001.mcap").read_bytes() == b"still written"


@pytest.mark.parametrize("name", ["../out", "/out", "a/../../out", "a\\..\\out", "nul", "data/COM1.mcap"])
async def test_hostile_names_write_nothing_at_all(tmp_path: Path, name: str) -> None:
    async with recording_robot(tmp_path, robot_with(**{"good": b"1", name: b"2"})) as robot:
        with pytest.raises(GatewayFailed, match="unusable name"):
            await copied(robot.port, tmp_path / "to")
    assert not (tmp_path / "to").exists()
    assert not (tmp_path / "out").exists()


async def test_a_recorder_that_goes_away_and_comes_back(tmp_path: Path) -> None:
    double = robot_with(**{FILE: LONG})
    async with recording_robot(tmp_path, double) as robot:
        options = ExportOptions(progress=partly(double, CHUNK_BYTES))
        copying = asyncio.create_task(copied(robot.port, tmp_path / "to", options))
        await rests(double)
        double.thawed.clear()  # The gateway takes it for gone after 2.5 s, and drops its connections.
        await reaches(robot, pb.RECORDER_STATE_UNREACHABLE)
        double.thawed.set()
        double.flowing.set()
        done = await asyncio.wait_for(copying, 60)
    assert done.cuts >= 1
    assert (tmp_path / "to/one" / FILE).read_bytes() == LONG


async def test_it_gives_up_when_nothing_comes_for_too_long(tmp_path: Path) -> None:
    double = robot_with()
    async with recording_robot(tmp_path, double) as robot:
        double.wrong_crcs = 1000
        with pytest.raises(Unreachable):
            await copied(robot.port, tmp_path / "to", ExportOptions(give_up_after_s=1.0))


async def test_the_same_recording_four_times_at_once(tmp_path: Path) -> None:
    async with recording_robot(tmp_path, robot_with()) as robot:
        folders = [tmp_path / str(number) for number in range(4)]
        await asyncio.gather(*(copied(robot.port, each) for each in folders))
    assert {sha256((each / "one" / FILE).read_bytes()) for each in folders} == {sha256(DATA)}


async def test_the_library_s_other_methods(tmp_path: Path) -> None:
    async with recording_robot(tmp_path, robot_with()) as robot:
        await all_methods(robot)


async def all_methods(robot: RecordingRobot) -> None:
    async with AsyncGatewayClient(f"127.0.0.1:{robot.port}") as client:
        started = (await client.start_recording("lap", preset="driving")).recording
        with pytest.raises(Refused) as caught:
            await client.start_recording()
        assert caught.value.reason == "RECORDING_RUNS"
        assert (await client.stop_recording()).recording.id == started.id
        snapshot = (await client.trigger_snapshot("there", pre_s=5)).recording
        assert {each.id async for each in client.recordings()} == {"one", started.id, snapshot.id}
        assert (await client.pin_recording("one")).recording.pinned
        with pytest.raises(GatewayError):
            await client.recording_thumbnail("one")
        robot.recorder.recordings["one"].video_frames = 1
        assert (await client.recording_thumbnail("one")).format == "h264"
        await client.delete_recording("one", force=True)
        assert "one" not in robot.recorder.recordings
