"""Exports through the gateway: whole, from an offset, at most so many, slowed down by a slow reader."""

import asyncio
from pathlib import Path
from typing import Any

import google_crc32c
import grpc

from common.reasons import Reason
from omniseer.gateway.v1 import recording_pb2 as pb
from tests.support.eventually import eventually
from tests.support.recorder_double import CHUNK_BYTES, RecorderDouble, sha256
from tests.support.recording_gateway import RecordingRobot, recording_robot
from tests.support.refusals import refused

FILE = "data/000000.mcap"
DATA = bytes(range(256)) * 1024 * 5 + b"end"
SLOW_READER_BYTES = 16 * 1024 * 1024
"""More than any buffer between the double and a caller that does not read: sockets and HTTP/2 windows."""


def robot_with(data: bytes) -> RecorderDouble:
    double = RecorderDouble()
    double.add({FILE: data}, id="one")
    return double


def opened(robot: RecordingRobot, **more: Any) -> Any:
    request = pb.ExportRecordingRequest(recording_id="one", file=FILE, **more)
    return robot.stub.ExportRecording(request, timeout=30)


async def to_its_end(stream: Any) -> None:
    while await stream.read() is not grpc.aio.EOF:
        pass


async def test_a_file_arrives_as_it_is_from_any_offset(tmp_path: Path) -> None:
    async with recording_robot(tmp_path, robot_with(DATA)) as robot:
        for offset in (0, 1, CHUNK_BYTES, len(DATA)):
            header, *chunks = await robot.exported("one", FILE, offset=offset, expected_sha256=sha256(DATA))
            assert (header.header.size, header.header.sha256) == (len(DATA), sha256(DATA))
            assert b"".join(each.chunk.data for each in chunks) == DATA[offset:]
            assert all(google_crc32c.value(each.chunk.data) == each.chunk.crc32c for each in chunks)


async def test_refusals_of_an_export(tmp_path: Path) -> None:
    async with recording_robot(tmp_path, robot_with(DATA)) as robot:
        beyond = opened(robot, offset=len(DATA) + 1)
        assert await refused(to_its_end(beyond)) == (grpc.StatusCode.INVALID_ARGUMENT, Reason.INVALID_REQUEST)
        other = opened(robot, expected_sha256=b"x" * 32)
        assert await refused(to_its_end(other)) == (grpc.StatusCode.ABORTED, Reason.RECORDING_CHANGED)
        robot.recorder.read_error = CHUNK_BYTES
        assert await refused(to_its_end(opened(robot))) == (
            grpc.StatusCode.DATA_LOSS,
            Reason.RECORDING_DAMAGED,
        )
        robot.recorder.unfinal.add(FILE)
        assert await refused(to_its_end(opened(robot))) == (
            grpc.StatusCode.FAILED_PRECONDITION,
            Reason.FILE_NOT_FINAL,
        )


async def test_four_of_a_caller_and_the_place_is_free_again(tmp_path: Path) -> None:
    async with recording_robot(tmp_path, robot_with(DATA)) as robot:
        robot.recorder.flowing.clear()
        streams = [opened(robot) for _ in range(4)]
        for each in streams:
            assert (await each.read()).HasField("header")
        expected = (grpc.StatusCode.RESOURCE_EXHAUSTED, Reason.TOO_MANY_EXPORTS)
        assert await refused(to_its_end(opened(robot))) == expected
        streams[0].cancel()

        async def another() -> bool:
            try:
                return bool((await opened(robot).read()).HasField("header"))
            except grpc.aio.AioRpcError:
                return False

        await eventually(another, bool, "a place that a caller has left is taken by another")
        robot.recorder.flowing.set()


async def test_a_reader_that_rests_lets_the_recorder_rest(tmp_path: Path) -> None:
    double = robot_with(bytes(SLOW_READER_BYTES))
    async with recording_robot(tmp_path, double) as robot:
        stream = opened(robot)
        await stream.read()

        async def sent() -> int:
            before = double.sent_bytes
            await asyncio.sleep(0.5)
            return double.sent_bytes if double.sent_bytes == before else -1

        rested = await eventually(sent, lambda bytes_sent: bytes_sent >= 0, "the recorder rests")
        assert rested < SLOW_READER_BYTES, "everything was read ahead of a caller that takes nothing"
        received = 0
        while (each := await stream.read()) is not grpc.aio.EOF:
            received += len(each.chunk.data)
        assert received == SLOW_READER_BYTES


async def test_a_deleted_recording_ends_its_export(tmp_path: Path) -> None:
    double = robot_with(DATA)
    async with recording_robot(tmp_path, double) as robot:
        double.flowing.clear()
        stream = opened(robot)
        await stream.read()
        await robot.stub.DeleteRecording(pb.DeleteRecordingRequest(request_id="d", recording_id="one"))
        double.flowing.set()
        assert await refused(to_its_end(stream)) == (grpc.StatusCode.ABORTED, Reason.RECORDING_DELETED)
