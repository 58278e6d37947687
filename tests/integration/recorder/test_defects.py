"""What no disk and no publisher should do to a recorder, and what becomes of a defect of its own."""

import asyncio
import threading
import time
from pathlib import Path

import pytest

from recorder.mcap.reading import messages
from recorder.recording.lifecycle import State
from recorder.recording.requests import StartOptions
from recorder.values import Item, Sample
from recorder.writing.output import Output
from recorder.writing.writer import FLUSH_S, WriterEndedError
from tests.support.recorder_in_process import Source, channel, running_recorder

WITHIN_S = 10.0
UINT64 = 1 << 64


@pytest.mark.parametrize("published_ns", [-1, -(1 << 63), UINT64, 1 << 70])
async def test_a_message_with_a_time_that_is_none_is_recorded(tmp_path: Path, published_ns: int) -> None:
    """A publisher without a time, or before 1970, ended the writer, and again after each restart."""
    async with running_recorder(tmp_path) as running:
        await running.operations.start("1", StartOptions())
        now_ns = time.time_ns()
        data = b"\0\1\0\0\2\0\0\0a\0"
        running.queue.put([Sample(channel(), data, now_ns, published_ns, 1, time.monotonic_ns())])
        done = (await running.operations.stop("2", "")).recording
        assert done
        segment = running.status_reader.folder_of(done) / done.segments[0].name
        assert list(messages(segment, "/odom")) == [(now_ns, data)]


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
async def test_a_defect_of_the_writer_ends_the_recorder_and_leaves_no_operation_waiting(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where the recorder is stopped while the writer's thread still cleans up."""
    abandon = Output.abandon

    def broken(_output: Output, _item: Item) -> None:
        raise ValueError("a defect")

    def slow(output: Output) -> None:
        threading.Event().wait(1.0)
        abandon(output)

    async def record() -> None:
        async with running_recorder(tmp_path) as running:
            await running.operations.start("1", StartOptions())
            monkeypatch.setattr(Output, "write", broken)
            monkeypatch.setattr(Output, "abandon", slow)
            Source(running.queue).send()
            with pytest.raises(WriterEndedError):
                await asyncio.wait_for(running.operations.stop("2", ""), WITHIN_S)

    with pytest.raises(RuntimeError, match="the writer has ended"):
        await record()


async def test_what_has_waited_is_flushed_in_between(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the disk is slow, what has waited takes seconds: a kill would cost all of them."""
    writes, flushes = Output.write, Output.flush
    done: list[str] = []

    def slow(output: Output, item: Item) -> None:
        threading.Event().wait(FLUSH_S / 4)
        writes(output, item)
        done.append("written")

    def counted(output: Output) -> None:
        flushes(output)
        done.append("flushed")

    async with running_recorder(tmp_path) as running:
        await running.operations.start("1", StartOptions())
        monkeypatch.setattr(Output, "write", slow)
        monkeypatch.setattr(Output, "flush", counted)
        source = Source(running.queue)
        with running.queue._changed:  # the writer gets them as one
            source.send(12)
        await running.until(lambda: done.count("written") == 12)
        first, last = done.index("written"), len(done) - done[::-1].index("written")
        assert done[first:last].count("flushed") >= 2
        await running.operations.stop("2", "")


async def test_a_caller_that_leaves_a_start_leaves_no_half_recording(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its deadline may pass while a slow disk opens the first file."""
    opening, released, opens = threading.Event(), threading.Event(), Output.open

    def slow(output: Output) -> None:
        opening.set()
        released.wait(WITHIN_S)
        opens(output)

    async with running_recorder(tmp_path) as running:
        with monkeypatch.context() as patched:
            patched.setattr(Output, "open", slow)
            call = asyncio.create_task(running.operations.start("1", StartOptions()))
            await running.until(opening.is_set)
            call.cancel()
            with pytest.raises(asyncio.CancelledError):
                await call
            released.set()
            await running.until(lambda: running.status_reader.phase.state is State.RECORDING)
        Source(running.queue).send(10)
        repeated = (await running.operations.start("1", StartOptions())).recording
        done = (await running.operations.stop("2", "")).recording
        assert repeated
        assert done
        assert (done.id, done.messages) == (repeated.id, 10)
