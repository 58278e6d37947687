"""One connection of the preview: a thread that hands a topic's newest frames over, one for each READY.

| failure | follows |
|---|---|
| the preview is gone, or closes | the subscription ends with the connection |
| it does not permit a frame | none is taken: the middleware's queue of one keeps the newest |
| it sends something that is no request, or none within 2 s | disconnected |
| a message that can't be shown | refused and counted; sent as a problem, at most twice a second |
| rclpy fails | sent as a problem; tried again with the next message |
| no memory for a frame | disconnected; the preview connects again with backoff |
| more messages than `max_fps` | the newest ones are taken at that rate, good or not |
"""

import logging
import select
import socket
import threading
import time
from collections.abc import Callable
from typing import Final

from common.camera_tap import (
    MAX_REQUEST_BYTES,
    READY,
    Asked,
    Kind,
    MalformedPacketError,
    decode_request,
    encode_text,
)
from common.receive_time import present_instant, received_at
from tap.camera import Camera, Graph
from tap.capture_time import CaptureTimes
from tap.delivery import send_frame
from tap.image import READERS
from tap.refusal import RefusedError
from tap.totals import Totals

_log = logging.getLogger(__name__)

REQUEST_WITHIN_S: Final = 2.0
_POLL_S: Final = 0.1
"""How soon the end of a connection is noticed while no messages come."""
_PROBLEM_EVERY_S: Final = 0.5
_LOG_EVERY_S: Final = 60.0
"""Of good and bad messages in turns, each bad one would be a line."""
_NS_PER_S: Final = 1_000_000_000


class Connection:
    """Serves a connection in a thread of its own, from `start` to `close`.

    Args:
        connected: its socket; closed at the end.
        graph: where the topics are.
        totals: what is counted.
        state: returns the tap's state, as JSON, for those that ask.
        min_interval_s: between two frames.

    Attributes:
        topic: that it hands over; empty before it is known.
        passed_s: monotonic time at which its thread last was not inside the middleware.
    """

    def __init__(
        self,
        connected: socket.socket,
        graph: Graph,
        totals: Totals,
        state: Callable[[], str],
        min_interval_s: float,
    ) -> None:
        self._socket, self._graph, self._totals, self._state = connected, graph, totals, state
        self._min_interval_s = min_interval_s
        self._closing = threading.Event()
        self._permitted = False
        self._problem, self._problem_at_s = "", 0.0
        self._log_at_s, self._unlogged = 0.0, 0
        self._refusal = ""
        """Of the newest message; empty if that was good."""
        self.topic = ""
        self.passed_s = time.monotonic()
        # A daemon, so that a middleware call that never returns can't prevent the process from exiting.
        self._thread = threading.Thread(target=self._run, name="camera", daemon=True)

    def start(self) -> None:
        """Starts the thread."""
        self._thread.start()

    @property
    def has_ended(self) -> bool:
        """Whether the connection has ended."""
        return not self._thread.is_alive()

    def close(self) -> None:
        """Makes the thread end soon."""
        self._closing.set()

    def join(self, timeout_s: float) -> bool:
        """Waits for the thread; whether it has ended."""
        self._thread.join(timeout_s)
        return self.has_ended

    def _run(self) -> None:
        try:
            with self._socket:
                self._serve()
        except MalformedPacketError as error:
            _log.warning("disconnected a client: it sent %s", error)
        except (ConnectionError, BlockingIOError):
            _log.info("%s: the preview is gone", self.topic or "a client")
        except OSError as error:
            _log.error("%s: disconnected: %s", self.topic or "a client", error.strerror or error)

    def _serve(self) -> None:
        self._socket.setblocking(False)
        request = self._receive(REQUEST_WITHIN_S)
        if not request:
            return
        asked, topic = decode_request(request)
        if asked is Asked.STATE:
            self._socket.send(encode_text(Kind.STATUS, self._state()))
            return
        if asked is Asked.PROBLEM:
            self._socket.send(encode_text(Kind.PROBLEM, self._graph.problem_of(topic)))
            return
        self.topic = topic
        self._totals.connected(topic)
        _log.info("%s: wanted", topic)
        camera = Camera(self._graph, topic)
        try:
            self._deliver(camera)
        finally:
            camera.close()
            _log.info("%s: not wanted any more", topic)

    def _deliver(self, camera: Camera) -> None:
        times = CaptureTimes()
        next_at_s = emptied_at_s = time.monotonic()
        while not self._closing.is_set() and self._take_permissions():
            now_s = self.passed_s = time.monotonic()
            camera.examine()
            self._report(camera.problem or self._refusal)
            if not self._permitted or now_s < next_at_s:
                self._poll(min(_POLL_S, next_at_s - now_s) if self._permitted else _POLL_S)
                continue
            if not camera.wait(_POLL_S):
                emptied_at_s = time.monotonic()
                if not camera.type_name:
                    self._poll(_POLL_S)
                continue
            next_at_s = time.monotonic() + self._min_interval_s
            self._hand_over(camera, times, emptied_at_s)
            emptied_at_s = time.monotonic()

    def _hand_over(self, camera: Camera, times: CaptureTimes, emptied_at_s: float) -> None:
        """Takes the newest message, and sends what it shows."""
        try:
            taken = camera.take()
        except Exception as error:  # noqa: BLE001  # rclpy raises many things, and the next message may be good
            self._refusal = f"{self.topic} can't be taken: {type(error).__name__}: {error}"
            return
        if taken is None:
            return
        message, received_ns = taken
        now = present_instant()
        try:
            frame = READERS[camera.type_name](message)
        except RefusedError as error:
            self._totals.refused(self.topic, error.reason)
            self._refusal = f"{self.topic} can't be shown: a message {error.text}"
            return
        arrived_ns = int(received_at(received_ns, now, emptied_at_s) * _NS_PER_S)
        replaced = times.replaced
        captured_ns = times.of(frame.stamp_ns, arrived_ns, now)
        self._permitted, self._refusal = False, ""
        send_frame(self._socket, frame, captured_ns)
        self._totals.sent(self.topic, frame.size, times.replaced - replaced)

    def _report(self, problem: str) -> None:
        """Sends a problem that is new, or the end of one."""
        now_s = time.monotonic()
        if problem == self._problem or now_s < self._problem_at_s:
            return
        self._problem, self._problem_at_s = problem, now_s + _PROBLEM_EVERY_S
        if problem:
            self._log(problem, now_s)
        self._socket.send(encode_text(Kind.PROBLEM, problem))

    def _log(self, problem: str, now_s: float) -> None:
        if now_s < self._log_at_s:
            self._unlogged += 1
            return
        earlier = f" (and {self._unlogged} more times since the last line)" if self._unlogged else ""
        _log.warning("%s%s", problem, earlier)
        self._log_at_s, self._unlogged = now_s + _LOG_EVERY_S, 0

    def _take_permissions(self) -> bool:
        """Takes what the preview has sent; False when it has closed.

        Raises:
            MalformedPacketError: it is not READY.
        """
        while (packet := self._receive(0.0)) is not None:
            if not packet:
                return False
            if packet != READY:
                raise MalformedPacketError("something else than READY")
            self._permitted = True
        return True

    def _receive(self, timeout_s: float) -> bytes | None:
        """Returns a packet, empty at the end of the connection; None if none has come in time."""
        if not self._poll(timeout_s):
            return None
        packet = self._socket.recv(MAX_REQUEST_BYTES + 1)
        if len(packet) > MAX_REQUEST_BYTES:
            raise MalformedPacketError("a packet that is too long")
        return packet

    def _poll(self, timeout_s: float) -> bool:
        """Waits until the preview has sent something; False if it has not in time."""
        poll = select.poll()
        poll.register(self._socket, select.POLLIN)
        return bool(poll.poll(max(0.0, timeout_s) * 1000))
