"""RecorderService over a real socket: every method, its errors, and exports."""

import asyncio
import hashlib
import os
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import grpc
import pytest

from omniseer.gateway.v1 import fault_pb2
from omniseer.gateway.v1 import recording_pb2 as pb
from omniseer.recorder.v1 import recorder_service_pb2 as recorder_pb
from recorder.mcap.writer import SegmentWriter
from recorder.rpc import file_pages
from recorder.rpc.file_pages import MOST_FILES
from recorder.store.folder import RECORDINGS, new_id, segment_name
from recorder.store.manifest import Kind, Manifest, RecordingState, Segment
from recorder.values import Gap, GapCause
from tests.support.promise import keeps_async
from tests.support.recorder_in_process import Source
from tests.support.refusals import refused
from tests.support.segments import string_sample
from tests.support.served_recorder import exported, served


async def test_a_recording_from_start_to_deletion(tmp_path: Path) -> None:
    async with served(tmp_path) as robot:
        states = robot.stub.WatchState(recorder_pb.WatchStateRequest())
        assert (await anext(aiter(states))).status.state == pb.RECORDER_STATE_IDLE
        made = await robot.recorded()
        assert made.state == pb.RECORDING_STATE_COMPLETE
        assert made.messages_written == 10
        assert made.messages_lost == 0
        assert [file.name for file in made.files] == ["data/000000.mcap", "data/metadata.yaml"]
        assert all(file.final and len(file.sha256) == 32 for file in made.files)
        pinned = await robot.stub.PinRecording(
            pb.PinRecordingRequest(request_id="pin", recording_id=made.id, pinned=True)
        )
        assert pinned.recording.pinned
        delete: dict[str, Any] = {"recording_id": made.id, "expected_sha256": made.sha256}
        kept = robot.stub.DeleteRecording(pb.DeleteRecordingRequest(request_id="1", **delete))
        assert await refused(kept) == (grpc.StatusCode.FAILED_PRECONDITION, "RECORDING_PINNED")
        await robot.stub.DeleteRecording(pb.DeleteRecordingRequest(request_id="2", force=True, **delete))
        asked = robot.stub.GetRecording(pb.GetRecordingRequest(recording_id=made.id))
        assert await refused(asked) == (grpc.StatusCode.NOT_FOUND, "RECORDING_NOT_FOUND")


async def test_a_running_recording_shows_what_is_final(tmp_path: Path) -> None:
    async with served(tmp_path) as robot:
        started = await robot.stub.StartRecording(pb.StartRecordingRequest(request_id="1"))
        Source(robot.running.queue).send(10)
        await robot.running.written(10)
        asked = pb.GetRecordingRequest(recording_id=started.recording.id)
        running = (await robot.stub.GetRecording(asked)).recording
        assert running.state == pb.RECORDING_STATE_RECORDING
        assert running.sha256 == b""
        assert [(file.name, file.final) for file in running.files] == [("data/000000.mcap", False)]
        assert running.file_count == 1
        request = pb.ExportRecordingRequest(recording_id=running.id, file="data/000000.mcap")
        call = robot.stub.ExportRecording(request)
        assert await refused(anext(aiter(call))) == (
            grpc.StatusCode.FAILED_PRECONDITION,
            "FILE_NOT_FINAL",
        )


async def test_an_export_goes_on_where_it_was_cut(tmp_path: Path) -> None:
    async with served(tmp_path) as robot:
        made = await robot.recorded(2_000_000)
        file = made.files[0]
        name = {"recording_id": made.id, "file": file.name}
        header, whole = await exported(robot.stub, **name)
        assert (header.size, header.sha256) == (file.size, file.sha256)
        assert hashlib.sha256(whole).digest() == file.sha256
        cut = 1_000_001
        _, rest = await exported(robot.stub, **name, offset=cut, expected_sha256=file.sha256)
        assert whole[cut:] == rest
        assert (await exported(robot.stub, **name, offset=file.size))[1] == b""
        changed = exported(robot.stub, **name, expected_sha256=b"x" * 32)
        assert await refused(changed) == (grpc.StatusCode.ABORTED, "RECORDING_CHANGED")
        beyond = exported(robot.stub, **name, offset=file.size + 1)
        assert await refused(beyond) == (grpc.StatusCode.INVALID_ARGUMENT, "INVALID_REQUEST")


@pytest.mark.parametrize(
    "file",
    ["../manifest.json", "manifest.json", "/etc/passwd", "data/../manifest.json", "data/000001.mcap", "data"],
)
async def test_no_name_leads_out_of_the_recording(tmp_path: Path, file: str) -> None:
    async with served(tmp_path) as robot:
        made = await robot.recorded()
        call = exported(robot.stub, recording_id=made.id, file=file)
        assert await refused(call) == (grpc.StatusCode.NOT_FOUND, "RECORDING_NOT_FOUND")
        for hostile in ("..", ".", "/", "../recordings/" + made.id, "\0", made.id + "/"):
            call = exported(robot.stub, recording_id=hostile, file=made.files[0].name)
            assert await refused(call) == (grpc.StatusCode.NOT_FOUND, "RECORDING_NOT_FOUND")


async def test_bytes_that_the_disk_has_changed_never_arrive_whole(tmp_path: Path) -> None:
    async with served(tmp_path) as robot:
        made = await robot.recorded(600_000)
        path = tmp_path / "root" / "recordings" / made.id / made.files[0].name
        with path.open("r+b") as file:
            file.seek(300_000)
            file.write(b"damaged")
        received: list[bytes] = []

        async def export() -> None:
            request = pb.ExportRecordingRequest(recording_id=made.id, file=made.files[0].name)
            async for part in robot.stub.ExportRecording(request):
                received.append(part.chunk.data)  # noqa: PERF401  # it ends with an error

        assert await refused(export()) == (grpc.StatusCode.DATA_LOSS, "RECORDING_DAMAGED")
        assert sum(map(len, received)) < made.files[0].size
        path.unlink()
        call = exported(robot.stub, recording_id=made.id, file=made.files[0].name)
        assert await refused(call) == (grpc.StatusCode.DATA_LOSS, "RECORDING_DAMAGED")


async def test_a_recording_deleted_while_it_is_exported(tmp_path: Path) -> None:
    async with served(tmp_path) as robot:
        made = await robot.recorded(3_000_000)
        request = pb.ExportRecordingRequest(
            recording_id=made.id, file=made.files[0].name, max_bytes_per_s=100_000
        )
        call = robot.stub.ExportRecording(request)
        parts = aiter(call)
        await anext(parts)
        await anext(parts)
        await robot.stub.DeleteRecording(pb.DeleteRecordingRequest(request_id="1", recording_id=made.id))

        async def rest() -> None:
            async for _ in parts:
                pass

        assert await refused(rest()) == (grpc.StatusCode.ABORTED, "RECORDING_DELETED")


@pytest.mark.timed
async def test_an_export_keeps_its_rate(tmp_path: Path) -> None:
    async with served(tmp_path) as robot:
        made = await robot.recorded(1_000_000)

        async def took_s() -> float:
            loop = asyncio.get_running_loop()
            began_s = loop.time()
            await exported(robot.stub, recording_id=made.id, file=made.files[0].name, max_bytes_per_s=500_000)
            lasted_s = loop.time() - began_s
            assert lasted_s > 1.5
            return lasted_s

        await keeps_async(4.0, "an export of 1 MB at 500 kB/s, s", took_s)


async def test_pages(tmp_path: Path) -> None:
    async with served(tmp_path) as robot:
        ids = [(await robot.recorded(1000 + number)).id for number in range(5)]
        found, token = [], ""
        while True:
            page = await robot.stub.ListRecordings(pb.ListRecordingsRequest(page_size=2, page_token=token))
            assert not any(each.files for each in page.recordings)
            assert {each.file_count for each in page.recordings} == {2}
            found += [each.id for each in page.recordings]
            if not (token := page.next_page_token):
                break
        assert sorted(found) == sorted(ids)
        assert page.status.recordings == 5
        bad = robot.stub.ListRecordings(pb.ListRecordingsRequest(page_token="nonsense"))
        assert await refused(bad) == (grpc.StatusCode.INVALID_ARGUMENT, "INVALID_REQUEST")


async def test_a_recording_of_more_files_than_a_page_is_listed_to_its_last_one(tmp_path: Path) -> None:
    folder = tmp_path / "root" / RECORDINGS / new_id(1.7e9)
    folder.mkdir(parents=True)
    count = 2 * MOST_FILES + 7
    segments = tuple(Segment(name=segment_name(each), size=1, sha256="0" * 64) for each in range(count))
    gap = Gap("", GapCause.DISK, 1, 2, None)
    Manifest(
        id=folder.name, kind=Kind.MANUAL, state=RecordingState.COMPLETE, segments=segments, gaps=(gap,)
    ).write(folder)
    async with served(tmp_path) as robot:
        pages, token = [], ""
        while True:
            asked = pb.GetRecordingRequest(recording_id=folder.name, page_token=token)
            pages.append(await robot.stub.GetRecording(asked))
            assert pages[-1].ByteSize() < 4 * 1024 * 1024, "what callers take"
            assert pages[-1].recording.file_count == count
            if not (token := pages[-1].next_page_token):
                break
        names = [file.name for page in pages for file in page.recording.files]
        assert names == [each.name for each in segments]
        assert [len(page.recording.files) for page in pages] == [MOST_FILES, MOST_FILES, 7]
        assert [len(page.recording.gaps) for page in pages] == [1, 0, 0]
        asked = pb.GetRecordingRequest(recording_id=folder.name, page_token="data/none.mcap")
        invalid = (grpc.StatusCode.INVALID_ARGUMENT, "INVALID_REQUEST")
        assert await refused(robot.stub.GetRecording(asked)) == invalid


async def test_a_run_bundle_of_more_files_than_a_page_is_listed_to_its_last_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(file_pages, "MOST_FILES", 3)
    bundle = tmp_path / "runs" / "first"
    bundle.mkdir(parents=True)
    (bundle / "manifest.yaml").write_text("state: complete\n", encoding="utf-8")
    for number in range(7):
        (bundle / f"{number}.jsonl").write_bytes(b"x")
    async with served(tmp_path, run_bundles=[str(tmp_path / "runs")]) as robot:
        files, token = [], ""
        while True:
            asked = pb.GetRecordingRequest(recording_id="run-first", page_token=token)
            page = await robot.stub.GetRecording(asked)
            files += page.recording.files
            if not (token := page.next_page_token):
                break
        assert [file.name for file in files] == [*(f"{number}.jsonl" for number in range(7)), "manifest.yaml"]
        assert page.recording.file_count == 8
        assert all(file.final and len(file.sha256) == 32 for file in files)


async def test_run_bundles_are_listed_and_exported_and_never_changed(tmp_path: Path) -> None:
    runs = tmp_path / "runs"
    bundle = runs / "2026-01-01 first run"
    (bundle / "video").mkdir(parents=True)
    (bundle / "manifest.yaml").write_text("run_id: 1\nstate: complete\n", encoding="utf-8")
    (bundle / "video" / "source.ts").write_bytes(b"ts" * 1000)
    (bundle / "video" / "outside").symlink_to("/etc/passwd")
    async with served(tmp_path, run_bundles=[str(runs), str(tmp_path / "missing")]) as robot:
        (listed,) = (await robot.stub.ListRecordings(pb.ListRecordingsRequest())).recordings
        assert (listed.kind, listed.label) == (pb.RECORDING_KIND_RUN_BUNDLE, bundle.name)
        asked = pb.GetRecordingRequest(recording_id=listed.id)
        whole = (await robot.stub.GetRecording(asked)).recording
        assert [file.name for file in whole.files] == ["manifest.yaml", "video/source.ts"]
        _, content = await exported(robot.stub, recording_id=listed.id, file="video/source.ts")
        assert content == b"ts" * 1000
        for name in ("video/outside", "../../etc/passwd", "video"):
            call = exported(robot.stub, recording_id=listed.id, file=name)
            assert await refused(call) == (grpc.StatusCode.NOT_FOUND, "RECORDING_NOT_FOUND")
        delete = pb.DeleteRecordingRequest(request_id="1", recording_id=listed.id, force=True)
        readonly = (grpc.StatusCode.FAILED_PRECONDITION, "RECORDING_READ_ONLY")
        assert await refused(robot.stub.DeleteRecording(delete)) == readonly
        pin = pb.PinRecordingRequest(request_id="2", recording_id=listed.id, pinned=True)
        assert await refused(robot.stub.PinRecording(pin)) == readonly
    assert (bundle / "video" / "source.ts").exists()


async def test_a_run_bundle_in_progress_is_shown_and_exported_once_it_has_ended(tmp_path: Path) -> None:
    bundle = tmp_path / "runs" / "first"
    bundle.mkdir(parents=True)
    manifest = bundle / "manifest.yaml"
    manifest.write_text("state: in_progress\n", encoding="utf-8")
    (bundle / "odometry.jsonl").write_bytes(b"{}\n")
    asked = pb.GetRecordingRequest(recording_id="run-first")
    async with served(tmp_path, run_bundles=[str(tmp_path / "runs")]) as robot:
        (listed,) = (await robot.stub.ListRecordings(pb.ListRecordingsRequest())).recordings
        assert listed.state == pb.RECORDING_STATE_RECORDING
        runs = (await robot.stub.GetRecording(asked)).recording
        assert {file.name: (file.final, file.sha256) for file in runs.files} == {
            "manifest.yaml": (False, b""),
            "odometry.jsonl": (False, b""),
        }
        call = exported(robot.stub, recording_id="run-first", file="odometry.jsonl")
        assert await refused(call) == (grpc.StatusCode.FAILED_PRECONDITION, "FILE_NOT_FINAL")
        manifest.write_text("state: incomplete\n", encoding="utf-8")
        ended = (await robot.stub.GetRecording(asked)).recording
        assert (ended.state, ended.stop_reason) == (
            pb.RECORDING_STATE_RECOVERED,
            pb.RECORDING_STOP_REASON_INTERRUPTED,
        )
        _, content = await exported(robot.stub, recording_id="run-first", file="odometry.jsonl")
        assert content == b"{}\n"


async def test_snapshots_and_incidents(tmp_path: Path) -> None:
    async with served(tmp_path) as robot:
        call = robot.stub.TriggerSnapshot(pb.TriggerSnapshotRequest(request_id="1"))
        assert await refused(call) == (grpc.StatusCode.FAILED_PRECONDITION, "NO_RING")
    async with served(tmp_path, ring={"preset": "all"}) as robot:
        Source(robot.running.queue).send(10)
        request = pb.TriggerSnapshotRequest(request_id="1", pre_s=5, post_s=0)
        made = await robot.stub.TriggerSnapshot(request, metadata=[("x-caller", "ann")])
        assert made.recording.trigger == "ann"
        wrong = robot.stub.TriggerSnapshot(pb.TriggerSnapshotRequest(request_id="2", preset="odometry"))
        assert await refused(wrong) == (grpc.StatusCode.INVALID_ARGUMENT, "INVALID_REQUEST")
        fault = recorder_pb.ReportFaultRequest(fault_id="a.b", severity=fault_pb2.FAULT_SEVERITY_ERROR)
        incident = await robot.stub.ReportFault(fault)
        assert incident.recording_id
        queued = pb.RecordingCopy(state=pb.RECORDING_COPY_STATE_QUEUED)
        copy = recorder_pb.SetCopyRequest(recording_id=incident.recording_id, copy=queued)
        await robot.stub.SetCopy(copy)
        asked = pb.GetRecordingRequest(recording_id=incident.recording_id)
        assert (await robot.stub.GetRecording(asked)).recording.copy.state == queued.state


async def test_after_a_start_with_an_old_time_the_state_can_be_had(tmp_path: Path) -> None:
    """The ring's files are of the future then: its length was negative, which no message takes."""
    ring = tmp_path / "root" / "ring"
    ring.mkdir(parents=True)
    writer = SegmentWriter(ring / "00000000.mcap.part")
    writer.write(replace(string_sample(1), log_time_ns=time.time_ns() + 3600 * 10**9))
    writer.finish()
    async with served(tmp_path, ring={"preset": "all"}) as robot:
        states = robot.stub.WatchState(recorder_pb.WatchStateRequest())
        state = await anext(aiter(states))
        assert 0 <= state.status.ring_s <= robot.running.settings.ring.seconds
        assert (await robot.stub.ListRecordings(pb.ListRecordingsRequest())).status.presets


async def test_a_file_from_before_1970_costs_no_list(tmp_path: Path) -> None:
    bundle = tmp_path / "runs" / "first"
    bundle.mkdir(parents=True)
    (bundle / "manifest.yaml").write_text("state: complete\n", encoding="utf-8")
    os.utime(bundle / "manifest.yaml", (-(10**9), -(10**9)))
    async with served(tmp_path, run_bundles=[str(tmp_path / "runs")]) as robot:
        (listed,) = (await robot.stub.ListRecordings(pb.ListRecordingsRequest())).recordings
        assert (listed.id, listed.started_unix_ms) == ("run-first", 0)


async def test_a_run_bundle_says_which_of_its_files_it_lacks_here(tmp_path: Path) -> None:
    bundle = tmp_path / "runs" / "first"
    bundle.mkdir(parents=True)
    (bundle / "manifest.yaml").write_text("state: complete\n", encoding="utf-8")
    async with served(tmp_path, run_bundles=[str(tmp_path / "runs")]) as robot:
        asked = pb.GetRecordingRequest(recording_id="run-first")
        assert (await robot.stub.GetRecording(asked)).recording.notes == ""
        (bundle / "a\nb").write_bytes(b"x")
        found = (await robot.stub.GetRecording(asked)).recording
        assert [file.name for file in found.files] == ["manifest.yaml"]
        assert found.notes.startswith("one of its files is not listed")


async def test_a_start_that_makes_no_sense(tmp_path: Path) -> None:
    async with served(tmp_path) as robot:
        for request, expected in (
            (pb.StartRecordingRequest(request_id=""), (grpc.StatusCode.INVALID_ARGUMENT, "INVALID_REQUEST")),
            (
                pb.StartRecordingRequest(request_id="1", preset="../all"),
                (grpc.StatusCode.INVALID_ARGUMENT, "INVALID_REQUEST"),
            ),
            (
                pb.StartRecordingRequest(request_id="1", with_video=True),
                (grpc.StatusCode.FAILED_PRECONDITION, "NO_VIDEO"),
            ),
        ):
            assert await refused(robot.stub.StartRecording(request)) == expected
