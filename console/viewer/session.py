"""One robot's preview for as long as a viewer is open: calls, calls again, keeps the newest picture."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final, TypeAlias

from common.errors import UserError
from console.client import GatewayError, PreviewState, PreviewStatus
from console.receiver.address import StreamAddress
from console.receiver.errors import NoFrameError, StreamError, UndecodableError
from console.receiver.frame import Frame, PixelFormat
from console.receiver.options import ReceiverOptions
from console.receiver.receiver import Receiver
from console.receiver.recording import Recording
from console.viewer.calling import Patience, Pauses, address_of
from console.viewer.decoders import Decoders
from console.viewer.state import Facts, ViewState, view_state

_LOOK_S: Final = 0.1
"""How often a call that brings nothing looks whether it is still wanted."""

Connect: TypeAlias = Callable[[StreamAddress, ReceiverOptions], Receiver]
OnPicture: TypeAlias = Callable[[Frame], None]


def _connect(address: StreamAddress, setup: ReceiverOptions) -> Receiver:
    return Receiver(address, queue_size=1, options=setup)


def _ignore(_frame: Frame) -> None:
    """Nobody wants to be told."""


@dataclass(frozen=True, slots=True)
class Figures:
    """What a session has done so far.

    Args:
        pictures: decoded and kept, for a moment at least.
        redials: calls of the stream beyond the first.
        decoder: GStreamer's element that makes the pictures; empty before the first.
    """

    pictures: int = 0
    redials: int = 0
    decoder: str = ""


class VideoSession:
    """Follows the stream that the robot's gateway names, by itself, until it is closed.

        session = VideoSession()
        session.start()
        session.follow(robot.status().preview)   # whenever the gateway has said something

    Every method may be called from any thread and returns at once, `close` excepted. What it does for a
    picture to come back: it hangs up after a second of silence and calls again, with short pauses; it calls
    another address as soon as it is told one. It counts its calls.

    Args:
        pixels: the form pictures are wanted in.
        on_picture: called in the session's thread with every new picture; must only hand over.
        recording: keeps the encoded stream, too; the caller closes it.
        decoders: who makes the pictures; by default hardware that has proven itself, else software.
        connect: makes calls; only tests give another one.
    """

    def __init__(
        self,
        *,
        pixels: PixelFormat = PixelFormat.BGRX,
        on_picture: OnPicture = _ignore,
        recording: Recording | None = None,
        decoders: Decoders | None = None,
        connect: Connect = _connect,
    ) -> None:
        self._pixels = pixels
        self._on_picture = on_picture
        self._recording = recording
        self._decoders = decoders or Decoders()
        self._connect = connect
        self._patience = Patience()
        self._pauses = Pauses()
        self._changing = threading.Condition()
        self._facts = Facts()
        self._address: StreamAddress | None = None
        self._latest: Frame | None = None
        self._figures = Figures()
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="video-session", daemon=True)

    def start(self) -> None:
        """Begins; the first call is made when an address is known."""
        self._decoders.start()
        self._thread.start()

    def watch_pictures(self, on_picture: OnPicture) -> None:
        """From now on tells somebody else of new pictures: in the session's thread; must only hand over."""
        self._on_picture = on_picture

    def follow(self, preview: PreviewStatus) -> None:
        """The gateway's newest word: where the stream is, and whether there should be one."""
        try:
            address, unusable = address_of(preview), None
        except UserError as error:
            address, unusable = None, error
        with self._changing:
            before = self._facts.preview
            self._facts = replace(self._facts, preview=preview, gateway_trouble=None)
            if unusable:
                self._facts = replace(self._facts, stream_trouble=unusable, blocked=True)
            if preview.state is PreviewState.RUNNING and before and before.state is not PreviewState.RUNNING:
                self._pauses.reset()
                self._changing.notify_all()
            if address != self._address:
                self._address = address
                if not unusable:
                    self._facts = replace(self._facts, stream_trouble=None, blocked=False)
                self._changing.notify_all()
            if preview.state is PreviewState.DISABLED:
                self._forget_picture()

    def lost(self, trouble: GatewayError) -> None:
        """The gateway does not answer. The stream goes on: it does not need the gateway."""
        with self._changing:
            self._facts = replace(self._facts, gateway_trouble=trouble)

    def latest(self) -> Frame | None:
        """The newest picture; None when there is none to show."""
        return self._latest

    def state(self) -> ViewState:
        """What to show beside the picture, at this moment."""
        return view_state(self._facts, time.monotonic())

    def figures(self) -> Figures:
        """What was done so far."""
        return self._figures

    def close(self, within_s: float = 2.0) -> bool:
        """Hangs up. Whether everything ended in time. Closing again does nothing."""
        with self._changing:
            self._closing = True
            self._changing.notify_all()
        if self._thread.ident is not None:
            self._thread.join(within_s)
        return not self._thread.is_alive()

    # In the session's thread.

    def _run(self) -> None:
        while not self._closing:
            address = self._address
            if address is None:
                self._wait(lambda: self._address is not None)
                continue
            trouble = self._call(address)
            if self._closing or address != self._address:
                continue
            blocked = not isinstance(trouble, StreamError) or trouble.final
            self._note(stream_trouble=trouble, blocked=blocked)
            self._wait(lambda: self._address != address, self._pauses.next_s(blocked=blocked))  # noqa: B023
            self._redialled()

    def _call(self, address: StreamAddress) -> UserError:
        """Shows one call's pictures until it is over, and says why it is."""
        setup = ReceiverOptions(self._pixels, self._decoders.chosen(), self._recording)
        try:
            with self._connect(address, setup) as receiver:
                return self._take_pictures(receiver, address)
        except UndecodableError as trouble:
            return self._decoders.after_undecodable(trouble)
        except UserError as trouble:
            return trouble

    def _take_pictures(self, receiver: Receiver, address: StreamAddress) -> UserError:
        called_s, picture_s = time.monotonic(), None
        while True:
            if self._closing or address != self._address:
                return StreamError("nobody wants this stream any more", "")
            try:
                frame = receiver.next_frame(_LOOK_S)
            except NoFrameError as silence:
                if time.monotonic() > self._patience.ends_s(called_s, picture_s):
                    if picture_s:
                        return _silent(address)
                    self._decoders.after_nothing()
                    return silence
            else:
                picture_s = frame.arrival_s
                self._keep(frame)

    def _keep(self, frame: Frame) -> None:
        with self._changing:
            if self._address is None:
                return
            self._latest = frame
            self._figures = replace(self._figures, pictures=self._figures.pictures + 1, decoder=frame.decoder)
            self._facts = replace(self._facts, picture_s=frame.arrival_s, stream_trouble=None, blocked=False)
            self._pauses.reset()
        self._on_picture(frame)

    def _forget_picture(self) -> None:
        self._latest = None
        self._facts = replace(self._facts, picture_s=None, stream_trouble=None, blocked=False)

    def _note(self, *, stream_trouble: UserError, blocked: bool) -> None:
        with self._changing:
            self._facts = replace(self._facts, stream_trouble=stream_trouble, blocked=blocked)

    def _redialled(self) -> None:
        with self._changing:
            redials = self._figures.redials + 1
            self._figures = replace(self._figures, redials=redials)
            self._facts = replace(self._facts, redials=redials)

    def _wait(self, unless: Callable[[], bool], seconds: float | None = None) -> None:
        with self._changing:
            self._changing.wait_for(lambda: self._closing or unless(), seconds)


def _silent(address: StreamAddress) -> StreamError:
    return StreamError(f"the stream from {address.uri} fell silent", "")
