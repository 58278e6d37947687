"""A recorder in the test's process on a real disk, with messages of the test's own in place of ROS."""

import asyncio
import time
from collections.abc import AsyncIterator, Iterable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path
from random import randbytes
from typing import Any, Final

from recorder.config import RecorderSettings
from recorder.mcap.reading import messages
from recorder.recording.assembly import build
from recorder.recording.lifecycle import State
from recorder.recording.operations import Operations
from recorder.recording.recorder import Recorder
from recorder.recording.status_reader import StatusReader
from recorder.store.folder import make_directory
from recorder.store.manifest import Manifest
from recorder.values import Channel, Sample
from recorder.writing.queue import SampleQueue
from tests.support.eventually import eventually

_WITHIN_S: Final = 20.0
PRESETS: Final = {"all": {"topics": ["*"]}, "odometry": {"topics": ["/odom"]}}


def channel(topic: str = "/odom", *, latched: bool = False, presets: Iterable[str] = ("all",)) -> Channel:
    return Channel(topic, "std_msgs/msg/String", b"string data", "ros2msg", "", latched, frozenset(presets))


@dataclass
class Source:
    """Messages of one channel, numbered from 1 on; each says its number."""

    queue: SampleQueue
    of: Channel = field(default_factory=channel)
    sent: int = 0

    def send(self, count: int = 1, size: int = 0, step_ns: int = 0) -> None:
        """Puts messages into the queue; `step_ns` is how far the calendar clock has stepped."""
        for _ in range(count):
            self.sent += 1
            text = b"%d." % self.sent + randbytes(size)  # that compression does not shrink
            data = b"\0\1\0\0" + (len(text) + 1).to_bytes(4, "little") + text + b"\0"
            now_ns = time.time_ns() + step_ns
            self.queue.put([Sample(self.of, data, now_ns, now_ns, self.sent, time.monotonic_ns())])


def numbers(status_reader: StatusReader, manifest: Manifest, topic: str = "/odom") -> list[int]:
    """What the messages of a `Source` say that a recording has, in order."""
    folder = status_reader.folder_of(manifest)
    return [
        int(data[8:].partition(b".")[0])
        for segment in manifest.segments
        for _, data in messages(folder / segment.name, topic)
    ]


class NoSources:
    problem = ""

    def __init__(self) -> None:
        self.presets: frozenset[str] = frozenset()
        self.video = False

    def want(self, presets: frozenset[str], *, video: bool) -> None:
        self.presets, self.video = presets, video

    async def caught_up(self) -> None:
        """Everything is in the queue as soon as it is sent."""


class LatchedMessages:
    """The newest message of each latched channel."""

    def __init__(self) -> None:
        self._newest: dict[Channel, Sample] = {}

    def take(self, sample: Sample) -> None:
        self._newest[sample.channel] = sample

    def forget(self, channel: Channel) -> None:
        self._newest.pop(channel, None)

    def samples(self) -> list[Sample]:
        return list(self._newest.values())


@dataclass
class Running:
    operations: Operations
    status_reader: StatusReader
    queue: SampleQueue
    sources: NoSources
    settings: RecorderSettings
    recorder: Recorder

    async def written(self, count: int) -> None:
        """Returns when so many messages of the running recording are on the disk."""
        await self.until(
            lambda: (
                self.status_reader.running is not None
                and self.status_reader.live(self.status_reader.running).messages >= count
            )
        )

    async def until(self, condition: Any) -> None:
        """Returns when a condition holds; fails after 20 s."""

        async def ask() -> Any:
            return condition()

        await eventually(ask, bool, "the recorder gets there", _WITHIN_S)


def settings_for(root: Path, **values: Any) -> RecorderSettings:
    room = {"min_free_bytes": 0}
    return RecorderSettings(**{"root": root, "presets": PRESETS, "room": room, **values})


@asynccontextmanager
async def running_recorder(root: Path, boot_id: str = "boot", **values: Any) -> AsyncIterator[Running]:
    """Recovered and idle, or recording, when the block begins; closed in order when it ends."""
    settings = settings_for(root, **values)
    make_directory(root)
    queue, sources = SampleQueue(settings.queue_bytes), NoSources()
    parts = build(settings, queue, sources, LatchedMessages(), boot_id=boot_id, run_id="run")
    status_reader = StatusReader(parts)
    recorder = Recorder(parts, status_reader)
    stop = asyncio.Event()
    task = asyncio.ensure_future(recorder.run(stop))
    operations = Operations(parts, status_reader, recorder)
    running = Running(operations, status_reader, queue, sources, settings, recorder)
    try:
        await running.until(lambda: task.done() or status_reader.phase.state is not State.RECOVERING)
        yield running
    finally:
        stop.set()
        async with asyncio.timeout(_WITHIN_S):
            await task
