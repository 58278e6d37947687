"""The thread that writes: the only one that touches segments."""

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import Future
from dataclasses import replace
from typing import Any, Final, Protocol, TypeVar

from recorder.values import Channel, Ended, Item, Note, Sample
from recorder.writing.output import Head, Output
from recorder.writing.queue import LEFT_OUT, SampleQueue

_log = logging.getLogger(__name__)
_T = TypeVar("_T")

FLUSH_S: Final = 0.5
"""Between two flushes to the disk: a power cut costs at most this and what the flush itself takes."""
_JOIN_S: Final = 10.0
_MAX_NOTES: Final = 32


class WriterEndedError(RuntimeError):
    """The writer's thread has ended: by a defect, which is in the log, or because it was stopped."""

    def __init__(self) -> None:
        super().__init__("the writer has ended")


class Latched(Protocol):
    """Keeps the newest messages of latched topics."""

    def take(self, sample: Sample) -> None:
        """Takes a message of a latched topic."""

    def forget(self, channel: Channel) -> None:
        """Forgets the messages of a topic that is no longer taken."""

    def samples(self) -> Iterable[Sample]:
        """Returns the messages that a late subscriber would get."""


class Writer:
    """Takes items from the queue and writes each to the outputs that select it.

    Outputs are added, rotated and closed by this thread, too, after everything that was queued before. An
    output that the disk fails is removed and reported; the others go on.

    Args:
        queue: what is written.
        latched: what the head of each segment repeats.
        failed: called, by this thread, with an output that was removed and the disk's error.
    """

    def __init__(
        self, queue: SampleQueue, latched: Latched, failed: Callable[[Output, OSError], None]
    ) -> None:
        self._queue = queue
        self._latched = latched
        self._failed = failed
        self._outputs: list[Output] = []
        self._notes: dict[str, Note] = {}
        """The newest of each name: what still holds when a segment begins."""
        self._jobs: deque[_Job] = deque()
        self._submitting = threading.Lock()
        self._ended = False
        """Whether no further job is done; under the lock."""
        self._stopping = False
        self._thread = threading.Thread(target=self._run, name="writer")

    def start(self) -> None:
        """Starts the thread."""
        self._thread.start()

    def stop(self) -> None:
        """Ends the thread after it has written what is queued; outputs must have been closed."""
        self._stopping = True
        self._queue.wake()
        self._thread.join(_JOIN_S)

    def add(self, output: Output) -> "Future[None]":
        """Opens an output; the future fails with the disk's OSError."""

        def job() -> None:
            try:
                output.open()
            except OSError:
                output.abandon()
                raise
            self._outputs.append(output)

        return self._submit(job)

    def rotate(self, output: Output) -> "Future[None]":
        """Makes an output's present segment final and opens the next one; does nothing after a failure."""
        return self._submit(lambda: self._each(Output.rotate, output))

    def remove(self, output: Output) -> "Future[bool]":
        """Closes an output; the future has whether that went well. A failure is reported like any other."""

        def job() -> bool:
            self._each(Output.close, output)
            if output not in self._outputs:
                return False
            self._outputs.remove(output)
            return True

        return self._submit(job)

    def head(self) -> Head:
        """Returns what the head of a segment repeats."""
        return Head(tuple(self._notes.values()), tuple(self._latched.samples()))

    @property
    def alive(self) -> bool:
        """Whether jobs are done; a defect ends that, and the thread as soon as it has cleaned up."""
        return not self._ended

    def _submit(self, work: Callable[[], _T]) -> "Future[_T]":
        """Queues something for the thread; the future fails with its OSError, or with WriterEndedError."""
        job = _Job(work)
        with self._submitting:
            if self._ended:
                job.future.set_exception(WriterEndedError())
            else:
                self._jobs.append(job)
        self._queue.wake()
        return job.future

    def _run(self) -> None:
        try:
            self._work()
        finally:
            # A caller that waits would do so for ever.
            with self._submitting:
                self._ended = True
            for job in self._jobs:
                job.future.set_exception(WriterEndedError())
            for output in self._outputs:
                output.abandon()

    def _work(self) -> None:
        flush_at_s = time.monotonic() + FLUSH_S
        while not (self._stopping and not self._jobs):
            # Before the items: what was put before a job was submitted is written before the job.
            jobs = len(self._jobs)
            wait_s = 0.0 if jobs else max(0.0, flush_at_s - time.monotonic())
            for item in self._queue.take(wait_s, so_far=jobs > 0):
                self._write(item)
                # Also within what has waited: on a slow disk it takes seconds.
                flush_at_s = self._flush_if_due(flush_at_s)
            for _ in range(jobs):
                self._jobs[0].run()
                self._jobs.popleft()
            flush_at_s = self._flush_if_due(flush_at_s)

    def _flush_if_due(self, at_s: float) -> float:
        """Flushes all outputs when it is due; returns when it is due next."""
        if time.monotonic() < at_s:
            return at_s
        self._each(Output.flush, *self._outputs)
        return time.monotonic() + FLUSH_S

    def _write(self, item: Item) -> None:
        if isinstance(item, Sample):
            if item.channel.latched:
                self._latched.take(item)
        elif isinstance(item, Ended):
            self._latched.forget(item.channel)
            return
        elif isinstance(item, Note) and (item.name in self._notes or len(self._notes) < _MAX_NOTES):
            self._notes[item.name] = _holding(item)
        for output in tuple(self._outputs):
            try:
                output.write(item)
            except OSError as error:
                self._drop(output, error)

    def _each(self, work: Callable[[Output], None], *outputs: Output) -> None:
        for output in outputs:
            if output not in self._outputs:
                continue
            try:
                work(output)
            except OSError as error:
                self._drop(output, error)

    def _drop(self, output: Output, error: OSError) -> None:
        _log.error("%s can't be written: %s", output.shape.directory, error.strerror)
        self._outputs.remove(output)
        output.abandon()
        self._failed(output, error)


def _holding(note: Note) -> Note:
    """Returns what holds of it in later segments, which lack none of those that it has replaced."""
    return replace(note, values={key: text for key, text in note.values.items() if key != LEFT_OUT})


class _Job:
    """Something for the writer's thread to do, and what comes of it.

    Args:
        work: what is done.
    """

    def __init__(self, work: Callable[[], Any]) -> None:
        self._work = work
        self.future: Future[Any] = Future()
        # It is done in any case: who waits may leave, but takes nothing back.
        self.future.set_running_or_notify_cancel()

    def run(self) -> None:
        """Does it. Any other error than the disk's is a defect, which ends the thread; see `Writer._run`."""
        try:
            result = self._work()
        except OSError as error:
            self.future.set_exception(error)
        else:
            self.future.set_result(result)
