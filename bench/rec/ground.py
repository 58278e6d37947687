"""What the benchmarks of recording share: a ROS domain, a publisher, and a recording."""

import json
import subprocess
import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from bench.processes import program
from omniseer.gateway.v1 import recording_pb2 as pb
from tests.support.running_recorder import RecorderProgram
from tests.support.waiting import wait_until

MB: Final = 1_000_000
PRESET: Final = {"all": {"topics": ["/bench/*"]}}
_WITHIN_S: Final = 60.0
_FIRST_MESSAGES: Final = 1000
"""Written by then: all topics are subscribed, with queues that fit their rates (some 1.5 s of messages)."""


@dataclass(frozen=True, slots=True)
class Talker:
    """A publisher in a process of its own (bench.rec.talker)."""

    process: subprocess.Popen[str]

    def numbers(self) -> dict[str, int]:
        """Returns the number of the newest message of each topic."""
        return self._ask("numbers")

    def stop(self) -> dict[str, int]:
        """Ends the publishing; returns the number of the last message of each topic."""
        return self._ask("stop")

    def _ask(self, word: str) -> dict[str, int]:
        assert self.process.stdin
        assert self.process.stdout
        self.process.stdin.write(f"{word}\n")
        self.process.stdin.flush()
        answer: dict[str, int] = json.loads(self.process.stdout.readline())
        return answer


@contextmanager
def talker(mb_per_s: int) -> Iterator[Talker]:
    """Yields a publisher of about so many MB a second (see bench.rec.talker)."""
    with program("bench.rec.talker", str(mb_per_s)) as process:
        yield Talker(process)


@dataclass(frozen=True, slots=True)
class Taking:
    """A recording that runs."""

    recorder: RecorderProgram
    id: str

    @property
    def folder(self) -> Path:
        """Where its files are."""
        return self.recorder.root / "recordings" / self.id

    def wait_until_written(self, messages: int) -> None:
        """Returns when so many messages are on the disk."""
        wait_until(
            lambda: self.recorder.state.status.messages_written >= messages,
            f"{messages} messages are written",
            _WITHIN_S,
        )

    def stop(self) -> pb.Recording:
        """Ends it, if it has not ended; returns it with its files."""
        found = self.recorder.recording(self.id)
        if found.state != pb.RECORDING_STATE_RECORDING:
            return found
        self.recorder.call("StopRecording", pb.StopRecordingRequest(request_id=uuid.uuid4().hex))
        return self.recorder.recording(self.id)


def begun(recorder: RecorderProgram, *, with_video: bool = False) -> Taking:
    """Starts a recording."""
    request = pb.StartRecordingRequest(request_id=uuid.uuid4().hex, with_video=with_video)
    return Taking(recorder, recorder.call("StartRecording", request).recording.id)


@contextmanager
def taking(recorder: RecorderProgram, *, with_video: bool = False) -> Iterator[Taking]:
    """Yields a recording that has been started; it is gone when the block ends."""
    made = begun(recorder, with_video=with_video)
    try:
        yield made
    finally:
        delete(recorder, made.stop())


@contextmanager
def taking_from(recorder: RecorderProgram) -> Iterator[Taking]:
    """Yields a recording of a talker, with all its topics."""
    with taking(recorder) as made:
        made.wait_until_written(_FIRST_MESSAGES)
        yield made


def delete(recorder: RecorderProgram, ended: pb.Recording) -> None:
    """Deletes a recording that has ended."""
    request = pb.DeleteRecordingRequest(
        request_id=uuid.uuid4().hex, recording_id=ended.id, expected_sha256=ended.sha256
    )
    recorder.call("DeleteRecording", request)


def between(first: Mapping[str, int], last: Mapping[str, int]) -> int:
    """Returns how many messages were published after the first numbers, up to the last ones."""
    return sum(last[topic] - first[topic] for topic in first)
