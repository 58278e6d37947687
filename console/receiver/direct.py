"""Direct delivery: packets are decoded as they arrive, in the order of their numbers, without SRT latency."""

import socket
import threading
import time
from contextlib import closing
from typing import Final

from console.name_lookup import resolve
from console.receiver.address import StreamAddress
from console.receiver.delivery import Delivery, DeliveryChoice
from console.receiver.errors import (
    StreamError,
    from_srt,
    no_picture,
    no_socket,
    receiver_failed,
    undecodable,
    unresolved,
)
from console.receiver.frame_queue import FrameQueue
from console.receiver.libsrt import LocalSocketError, SrtError, SrtSocket
from console.receiver.options import CLOSES_WITHIN_S, ReceiverOptions
from console.receiver.reception import Reception
from console.receiver.rejoins import Rejoins
from console.receiver.transport_stream import UnknownVideoError
from console.receiver.unit_decoder import UnitDecoder

_ANY_HOST: Final = "127.0.0.1"
_HANDSHAKE_POLL_S: Final = 0.002
"""Period of looking whether the handshake, which takes two round trips, is done."""
_UNEXPLAINED_S: Final = 3.0
"""As long as SRT tries one handshake (SRTO_CONNTIMEO)."""
_UNEXPLAINED_PAUSE_S: Final = 0.1
_RESOLVES_WITHIN_S: Final = 3.0


class DirectConnection:
    """Connects to the robot, fills a frame queue, and ends the queue with the reason of a failure.

    A thread of its own receives; GStreamer decodes on another one. The connection is made anew, without an
    end, when that is the quickest way to a frame of now: see `Reception`. Where one after the other brings no
    picture, the stream ends: see `Rejoins`.

    Args:
        address: SRT listener to connect to.
        queue: takes the frames and the end of the stream.
        options: of the receiver.

    Raises:
        DirectImpossibleError: there is no usable libsrt, or it gets no socket.
        UserError: a GStreamer element is not installed.
    """

    def __init__(self, address: StreamAddress, queue: FrameQueue, options: ReceiverOptions) -> None:
        # Here, where another delivery can still be chosen.
        SrtSocket(_ANY_HOST, address.port, address.latency_ms, address.passphrase).close()
        self._address = address
        self._queue = queue
        self._options = options
        self._decoder = UnitDecoder(address, queue, options)
        self._had_data = False
        self._rejoins = Rejoins(time.monotonic())
        self._undecoded = False
        """Whether access units have come over the connections since the newest picture."""
        self._give_up_s: float | None = None
        self.delivery = Delivery(kind=DeliveryChoice.DIRECT)
        """Figures of the delivery; replaced a few times per second."""
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="receiver", daemon=True)
        self._thread.start()

    @property
    def received_s(self) -> float | None:
        """When the newest frame was received, on `time.monotonic()`; None before the first."""
        return self._decoder.newest_s

    def close(self) -> bool:
        """Disconnects. Afterwards nothing reaches the queue.

        Returns:
            Whether that took less than `CLOSES_WITHIN_S`. A driver that hangs is left behind with its thread.
        """
        self._stopping.set()
        self._thread.join(CLOSES_WITHIN_S)
        return not self._thread.is_alive()

    # On the receiver's thread.

    def _run(self) -> None:
        with closing(self._decoder):
            try:
                while not self._stopping.is_set():
                    self._receive()
            except StreamError as error:
                self._queue.end(error)
            except UnknownVideoError as error:
                self._queue.end(undecodable(self._address, str(error)))
            except Exception as error:
                # A defect of our own must not look like a robot that sends nothing. stderr has the traceback.
                self._queue.end(receiver_failed(error))
                raise

    def _receive(self) -> None:
        """Receives over one connection until it is to be made anew, or closed."""
        address = self._address
        host = self._resolved()
        before_s, unit_s = self._queue.newest_s, self._decoder.newest_s
        try:
            connection = SrtSocket(host, address.port, address.latency_ms, address.passphrase)
            with closing(connection):
                connection.connect()
                if not self._is_established(connection):
                    return
                self._take_packets(connection)
        except LocalSocketError as error:
            raise no_socket(address, str(error), error.remedy) from error
        except (SrtError, OSError) as error:
            reason = (error.strerror if isinstance(error, OSError) else None) or str(error)
            raise from_srt(address, reason, had_data=self._had_data) from error

        shown_s = self._queue.newest_s
        self._pace(shown_s if shown_s != before_s else None, undecoded=self._decoder.newest_s != unit_s)

    def _pace(self, shown_s: float | None, *, undecoded: bool) -> None:
        """Waits until the next connection is due, or raises why there is none."""
        now_s = time.monotonic()
        pause_s = self._rejoins.pause_s(now_s, shown_s)
        self._undecoded = shown_s is None and (undecoded or self._undecoded)
        if pause_s is not None:
            self._stopping.wait(pause_s)
        elif self._undecoded:
            raise undecodable(self._address, "frames that bring no picture")
        else:
            raise no_picture(self._address, self._rejoins.without_s(now_s))

    def _resolved(self) -> str:
        """Returns the numeric address of the host, IPv4 where there is one."""
        address = self._address
        try:
            found = resolve(address.host, address.port, socket.SOCK_DGRAM, _RESOLVES_WITHIN_S, self._stopping)
        except OSError as error:
            raise unresolved(address, error) from error
        ipv4 = [each for each in found if each[0] == socket.AF_INET]
        return str((ipv4 or found)[0][4][0])

    def _is_established(self, connection: SrtSocket) -> bool:
        """Waits for the end of the handshake; returns whether it succeeded, or raises why it failed.

        One that failed without a reason is made again for a while: a listener that is busy with other callers
        breaks a handshake off and gives none.
        """
        while connection.connecting:
            if self._stopping.wait(_HANDSHAKE_POLL_S):
                return False
        if connection.connected:
            self._give_up_s = None
            return True
        now_s = time.monotonic()
        self._give_up_s = self._give_up_s or now_s + _UNEXPLAINED_S
        if not connection.failed_unexplained or now_s > self._give_up_s:
            raise SrtError(connection.reject_reason())
        self._stopping.wait(_UNEXPLAINED_PAUSE_S)
        return False

    def _take_packets(self, connection: SrtSocket) -> None:
        reception = Reception(connection, self._decoder, self._options, self.delivery, self._report)
        try:
            reception.run(self._stopping)
        finally:
            self._had_data = self._had_data or reception.had_data

    def _report(self, delivery: Delivery) -> None:
        self.delivery = delivery
