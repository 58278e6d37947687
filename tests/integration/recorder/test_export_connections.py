"""Files of exports are handed to the gateway: the recorder's end and the gateway's, over real sockets."""

import asyncio
import fcntl
import os
import socket
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, aclosing, asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import grpc
import psutil
import pytest

from common import bind, rpc
from common.export_connection import (
    CONNECT_WITHIN_S,
    KEY_BYTES,
    KEY_HEADER,
    ORDER,
    TAKEN,
    socket_beside,
)
from common.open_file import CHUNK_BYTES, Chunk
from common.reader_threads import ReaderThreads
from gateway.links.recorder import wire
from gateway.links.recorder.export_connection import HandedFile, handed_file
from gateway.links.recorder.wire import RecorderClient, RecorderConnector
from gateway.rpc.mapping.export import message_parts
from omniseer.gateway.v1 import recording_pb2 as pb
from omniseer.recorder.v1 import recorder_service_pb2_grpc as pb_grpc
from recorder.rpc.export_connections import MAX_UNKNOWN, ExportConnections
from recorder.rpc.servicer import RecorderServicer
from recorder.store import sums
from recorder.store.readers import reader_threads
from tests.support.descriptors import descriptors_of
from tests.support.eventually import eventually
from tests.support.promise import keeps_async
from tests.support.recorder_in_process import Running, Source, running_recorder
from tests.support.refusals import refused

MIB = 1024 * 1024
METADATA = (("x-caller", "ann"),)


def as_bytes(response: bytes | Chunk) -> bytes:
    """What the gateway's caller gets."""
    return response if isinstance(response, bytes) else b"".join(message_parts(response))


@dataclass
class Robot:
    """A recorder with a finished recording, and the gateway's client of it.

    Attributes:
        handed: keys of the connections that have handed a file over.
    """

    running: Running
    socket: Path
    client: RecorderClient
    recording: pb.Recording
    handed: list[bytes]

    def request(self, **more: Any) -> bytes:
        name = self.recording.files[0].name
        request = pb.ExportRecordingRequest(recording_id=self.recording.id, file=name, **more)
        return request.SerializeToString()

    async def exported(self, **more: Any) -> list[bytes]:
        return [as_bytes(each) async for each in self.client.export(self.request(**more), METADATA)]

    async def over_the_call(self, **more: Any) -> list[bytes]:
        """The same without a connection, as a gateway takes it that knows none of this."""
        async with grpc.aio.insecure_channel(f"unix:{self.socket}") as channel:
            method: Any = channel.unary_stream("/omniseer.recorder.v1.RecorderService/ExportRecording")
            return [each async for each in method(self.request(**more))]

    @property
    def path(self) -> Path:
        root = self.running.settings.root
        return root / "recordings" / self.recording.id / self.recording.files[0].name


@asynccontextmanager
async def robot(
    root: Path, monkeypatch: pytest.MonkeyPatch, size: int = 3 * MIB, **settings: Any
) -> AsyncIterator[Robot]:
    handed: list[bytes] = []

    @asynccontextmanager
    async def counted(path: Path, key: bytes, threads: ReaderThreads) -> AsyncIterator[HandedFile | None]:
        async with handed_file(path, key, threads) as file:
            if file:
                handed.append(key)
            yield file

    monkeypatch.setattr(wire, "handed_file", counted)
    address = root / "recorder.sock"
    async with running_recorder(root / "root", **settings) as running, AsyncExitStack() as stack:
        server, connections = rpc.new_server(), ExportConnections()
        readers = stack.enter_context(reader_threads())
        servicer = RecorderServicer(
            running.operations, running.status_reader, running.settings, readers, connections
        )
        stack.push_async_callback(servicer.close)
        servicer.register(server)
        bind.bind_unix(server, address)
        await server.start()
        async with connections.listening(address):
            try:
                made = await recorded(address, running, size)
                async with RecorderConnector(address).connect() as client:
                    yield Robot(running, address, client, made, handed)
            finally:
                await server.stop(None)
    assert not socket_beside(address).exists()


async def recorded(address: Path, running: Running, size: int) -> pb.Recording:
    async with grpc.aio.insecure_channel(f"unix:{address}") as channel:
        stub: Any = pb_grpc.RecorderServiceStub(channel)
        await stub.StartRecording(pb.StartRecordingRequest(request_id="start"))
        Source(running.queue).send(10, size=size // 10)
        stopped = await stub.StopRecording(pb.StopRecordingRequest(request_id="stop"))
        asked = pb.GetRecordingRequest(recording_id=stopped.recording.id)
        found: pb.Recording = (await stub.GetRecording(asked)).recording
        return found


def connected(address: Path) -> socket.socket:
    made = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    made.connect(str(socket_beside(address)))
    return made


async def disconnects(peer: socket.socket) -> bool:
    """Whether the recorder has closed a connection."""
    peer.setblocking(False)
    try:
        return peer.recv(1) == b""
    except BlockingIOError:
        return False
    except ConnectionResetError:
        return True


@pytest.fixture
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Both ends wait longer for each other: after 2 s on a busy machine the call would carry the chunks."""
    for module in (
        "recorder.rpc.exporter",
        "recorder.rpc.export_connections",
        "gateway.links.recorder.export_connection",
    ):
        monkeypatch.setattr(f"{module}.CONNECT_WITHIN_S", 20.0)


@pytest.mark.parametrize("offset", [0, 1, CHUNK_BYTES, 1_000_001])
@pytest.mark.usefixtures("patient")
async def test_the_gateway_reads_what_the_call_would_carry(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, offset: int
) -> None:
    async with robot(tmp_path, monkeypatch) as recorder:
        found = await recorder.exported(offset=offset)
        assert len(recorder.handed) == 1
        assert found == await recorder.over_the_call(offset=offset)
        chunks = [pb.ExportRecordingResponse.FromString(each).chunk for each in found[1:]]
        assert b"".join(each.data for each in chunks) == recorder.path.read_bytes()[offset:]
        assert len(recorder.handed) == 1


@pytest.mark.usefixtures("patient")
async def test_exports_at_once_have_a_connection_each(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with robot(tmp_path, monkeypatch) as recorder:
        expected = await recorder.over_the_call()
        found = await asyncio.gather(*(recorder.exported() for _ in range(8)))
        assert all(each == expected for each in found)
        assert len(recorder.handed) == 8


async def test_chunks_go_over_the_call_where_nothing_listens(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with robot(tmp_path, monkeypatch) as recorder:
        expected = await recorder.over_the_call()
        beside = socket_beside(recorder.socket)
        away = beside.rename(tmp_path / "away")
        assert await recorder.exported() == expected
        assert recorder.handed == []
        away.rename(beside)


async def test_a_path_too_long_for_a_second_socket_makes_exports_slower_alone(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    connections = ExportConnections()
    address = tmp_path / ("a" * (107 - len(bytes(tmp_path)) - 1))
    async with connections.listening(address):
        with connections.expected(bytes(KEY_BYTES)) as coming:
            assert coming is None
    assert "exports will be slower" in caplog.text


@pytest.mark.usefixtures("patient")
async def test_damage_and_deletion_end_the_call_with_the_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with robot(tmp_path, monkeypatch) as recorder:
        exported = recorder.client.export(recorder.request(max_bytes_per_s=MIB // 10), METADATA)
        await anext(exported)
        await anext(exported)
        assert recorder.handed
        await recorder.running.operations.delete("1", recorder.recording.id, b"", force=True)

        async def rest() -> None:
            async for _ in exported:
                pass

        assert await refused(rest()) == (grpc.StatusCode.ABORTED, "RECORDING_DELETED")
    async with robot(tmp_path / "other", monkeypatch) as recorder:
        with recorder.path.open("r+b") as file:
            file.seek(100)
            file.write(b"damaged")
        received: list[bytes] = []

        async def export() -> None:
            async for each in recorder.client.export(recorder.request(), METADATA):
                received.append(as_bytes(each))  # noqa: PERF401  # it ends with an error

        assert await refused(export()) == (grpc.StatusCode.DATA_LOSS, "RECORDING_DAMAGED")
        assert sum(map(len, received)) < recorder.recording.files[0].size


async def test_a_caller_who_leaves_leaves_nothing_open(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with robot(tmp_path, monkeypatch, 16 * MIB) as recorder:
        await recorder.exported()
        before = psutil.Process().num_fds()
        for _ in range(3):
            async with aclosing(recorder.client.export(recorder.request(), METADATA)) as exported:
                for _ in range(3):
                    await anext(exported)

        async def open_now() -> int:
            return psutil.Process().num_fds()

        await eventually(open_now, lambda now: now <= before, "files and sockets are closed")


async def test_a_gateway_that_does_not_read_makes_the_recorder_wait(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with robot(tmp_path, monkeypatch, 16 * MIB) as recorder:
        expected = await recorder.over_the_call()
        async with aclosing(recorder.client.export(recorder.request(), METADATA)) as exported:
            found = [as_bytes(await anext(exported)), as_bytes(await anext(exported))]
            # Another one is served meanwhile, whole.
            assert await recorder.exported() == expected
            async for each in exported:
                found.append(as_bytes(each))  # noqa: PERF401  # begun before
        assert found == expected


async def test_strangers_are_disconnected_and_hurt_no_export(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with robot(tmp_path, monkeypatch) as recorder:
        expected = await recorder.over_the_call()
        guess, silent = connected(recorder.socket), connected(recorder.socket)
        guess.sendall(os.urandom(KEY_BYTES) + b"more than a key")
        half = connected(recorder.socket)
        half.sendall(b"ha")
        half.close()
        assert await recorder.exported() == expected
        await eventually(lambda: disconnects(guess), bool, "a wrong key is disconnected")
        within_s = CONNECT_WITHIN_S + 5
        await eventually(lambda: disconnects(silent), bool, "so is who sends none", within_s)
        crowd = [connected(recorder.socket) for _ in range(MAX_UNKNOWN + 8)]
        await eventually(lambda: disconnects(crowd[-1]), bool, "more than MAX_UNKNOWN are disconnected")
        # With no room for a connection the call carries the chunks.
        assert await recorder.exported() == expected
        for each in (guess, silent, *crowd):
            each.close()


@pytest.mark.parametrize("key", ["", "no digits", "00" * (KEY_BYTES + 1), "00" * (KEY_BYTES - 1)])
async def test_a_call_with_another_key_gets_its_chunks_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, key: str
) -> None:
    async with robot(tmp_path, monkeypatch) as recorder:
        async with grpc.aio.insecure_channel(f"unix:{recorder.socket}") as channel:
            method: Any = channel.unary_stream("/omniseer.recorder.v1.RecorderService/ExportRecording")
            call = method(recorder.request(), metadata=((KEY_HEADER, key),))
            found = [each async for each in call]
        assert found == await recorder.over_the_call()


@pytest.mark.parametrize(
    "settings", [{}, {"export": {"max_bytes_per_s": MIB}}], ids=["handed over", "over the call"]
)
@pytest.mark.usefixtures("patient")
async def test_a_deleted_recording_is_closed_at_both_ends_though_it_is_not_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, settings: dict[str, Any]
) -> None:
    async with (
        robot(tmp_path, monkeypatch, 16 * MIB, **settings) as recorder,
        aclosing(recorder.client.export(recorder.request(), METADATA)) as exported,
    ):
        await anext(exported)
        await anext(exported)
        assert bool(recorder.handed) is not bool(settings), "a limit of all exports is the recorder's to keep"
        assert descriptors_of(recorder.path)
        await recorder.running.operations.delete("1", recorder.recording.id, b"", force=True)

        async def found() -> list[int]:
            return descriptors_of(recorder.path)

        await eventually(found, lambda now: not now, "its blocks are free")


@pytest.mark.usefixtures("patient")
async def test_the_descriptor_is_for_reading_this_file_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with (
        robot(tmp_path, monkeypatch) as recorder,
        aclosing(recorder.client.export(recorder.request(), METADATA)) as exported,
    ):
        await anext(exported)
        await anext(exported)
        found = descriptors_of(recorder.path)
        assert len(found) >= 2, "the recorder's and the gateway's"
        for each in found:
            assert fcntl.fcntl(each, fcntl.F_GETFL) & os.O_ACCMODE == os.O_RDONLY
            assert fcntl.fcntl(each, fcntl.F_GETFD) & fcntl.FD_CLOEXEC


@pytest.mark.timed
@pytest.mark.usefixtures("patient")
async def test_the_gateway_keeps_the_limit_of_an_export(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with robot(tmp_path, monkeypatch, MIB) as recorder:

        async def took_s() -> float:
            loop = asyncio.get_running_loop()
            began_s = loop.time()
            await recorder.exported(max_bytes_per_s=500_000)
            lasted_s = loop.time() - began_s
            assert lasted_s > 1.5
            return lasted_s

        await keeps_async(4.0, "an export of 1 MiB at 500 kB/s, s", took_s)
        assert recorder.handed


async def test_a_second_export_reads_the_file_once_for_both(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with robot(tmp_path, monkeypatch) as recorder:
        taken: list[int] = []
        take = sums._take

        def counted(descriptor: int, size: int, begun: Any) -> None:
            taken.append(size)
            take(descriptor, size, begun)

        monkeypatch.setattr(sums, "_take", counted)
        await asyncio.gather(*(recorder.exported() for _ in range(4)))
        await recorder.exported(offset=MIB)
        assert sum(taken) == recorder.recording.files[0].size


@pytest.mark.parametrize(
    ("sent", "what"),
    [
        (b"", None),
        (ORDER.pack(0, 5, 0), None),
        (ORDER.pack(0, 5, 0)[:-1], "file"),
        (ORDER.pack(0, 5, 0), "directory"),
        (ORDER.pack(0, 5, 0), "fifo"),
    ],
)
async def test_the_gateway_takes_files_alone(tmp_path: Path, sent: bytes, what: str | None) -> None:
    (tmp_path / "file").write_bytes(b"bytes")
    (tmp_path / "directory").mkdir()
    os.mkfifo(tmp_path / "fifo")
    descriptors = [os.open(tmp_path / what, os.O_RDONLY | os.O_NONBLOCK)] if what else []
    before = psutil.Process().num_fds()
    received = await handed_by(tmp_path / "socket", sent, descriptors)
    assert received == (b"", None)
    # Of the whole process, in which something of an earlier test may end meanwhile.
    assert psutil.Process().num_fds() <= before, "a descriptor was kept"
    if what:
        assert descriptors_of(tmp_path / what) == descriptors
    for each in descriptors:
        os.close(each)


@pytest.mark.usefixtures("patient")
async def test_the_gateway_reads_the_range_that_it_is_given(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"some bytes of a file")
    descriptor = os.open(tmp_path / "file", os.O_RDONLY)
    received = await handed_by(tmp_path / "socket", ORDER.pack(5, 10, 0), [descriptor])
    assert received == (TAKEN, b"bytes")
    os.close(descriptor)


async def handed_by(path: Path, sent: bytes, descriptors: list[int]) -> tuple[bytes, bytes | None]:
    """What a recorder that sends this is answered, and what the gateway reads then."""
    key, loop = os.urandom(KEY_BYTES), asyncio.get_running_loop()
    threads = ReaderThreads("files", threads=1, most=1)
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK) as listener:
        listener.bind(str(path))
        listener.listen()

        async def recorder() -> bytes:
            connected, _ = await loop.sock_accept(listener)
            with connected:
                assert await loop.sock_recv(connected, KEY_BYTES) == key
                if sent:
                    socket.send_fds(connected, [sent], descriptors)
                    return await loop.sock_recv(connected, 1)
                return b""

        answering = asyncio.create_task(recorder())
        async with handed_file(path, key, threads) as handed:
            block = await handed.file.block(handed.offset) if handed else None
        threads.close()
        data = None if block is None else b"".join(each.data for each in block)
        return await answering, data
