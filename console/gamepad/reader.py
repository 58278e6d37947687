"""Reads a gamepad in a thread of its own, which owns SDL: a device that hangs delays no window."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Protocol

from common.errors import UserError
from common.printable import printable
from console.gamepad.hands import PadHands, PadInput
from console.gamepad.sdl import SdlPad, library
from console.gamepad.silence import SILENT, Silence
from console.steering import Steering

PERIOD_S: Final = 0.008
"""Between two readings: that of a USB gamepad (125 Hz)."""
READING_COUNTS_S: Final = 0.1
"""An older reading is a release: the thread hangs in a device. When it goes on, what is held has to be held
anew: no recovery of a device moves the robot."""
_END_S: Final = 1.0


class PadDevice(Protocol):
    """A gamepad, or the place for one; `console.gamepad.sdl.SdlPad` is one."""

    name: str

    def read(self) -> PadInput | None:
        """Returns the present input; None without a gamepad."""

    def close(self) -> None:
        """Gives it back."""


@dataclass(frozen=True, slots=True)
class _Reading:
    steering: Steering | None
    name: str
    at_s: float
    silent: bool = False


class GamepadReader:
    """The gamepad that is plugged in, if any. Thread-safe; only `close` waits.

    Args:
        device: makes the device, in the thread that reads it.
    """

    def __init__(self, device: Callable[[], PadDevice] = SdlPad) -> None:
        self._device = device
        self._hands, self._lock = PadHands(), threading.Lock()
        self._silence = Silence()
        self._newest = _Reading(None, "", 0.0)
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="gamepad", daemon=True)
        self.error: UserError | None = None
        """Why no gamepad is read; None while they are."""

    def start(self) -> None:
        """Starts the thread."""
        self._thread.start()

    @property
    def name(self) -> str:
        """The gamepad that is plugged in, as it names itself; empty without one."""
        return self._newest.name

    def description(self) -> str:
        """Returns which gamepad there is, or why there is none, for people."""
        return str(self.error or "") or self.name or "no gamepad is plugged in"

    def problem(self) -> str:
        """Returns why what is held does not count any more, for people; empty without such a reason."""
        return SILENT if self._newest.silent else ""

    def steering(self) -> Steering | None:
        """Returns how it steers; None while it does not hold, and when the last reading is too old."""
        newest = self._newest
        return newest.steering if time.monotonic() - newest.at_s <= READING_COUNTS_S else None

    def take_stop(self) -> bool:
        """Returns whether its button for STOP was pressed since the last call."""
        with self._lock:
            return self._hands.take_stop()

    def forget(self) -> None:
        """Releases; everything has to be seen released, and neutral, anew."""
        with self._lock:
            self._hands.forget()
            self._newest = _Reading(None, self._newest.name, self._newest.at_s)

    def close(self) -> None:
        """Ends the thread."""
        self._ending.set()
        if self._thread.ident is not None:
            self._thread.join(_END_S)

    def _run(self) -> None:
        try:
            device = self._device()
        except UserError as error:
            self.error = error
            return
        try:
            while not self._ending.wait(PERIOD_S):
                self._take(device.read(), device.name)
        finally:
            self._newest = _Reading(None, "", 0.0)
            device.close()

    def _take(self, pad: PadInput | None, name: str) -> None:
        now_s = time.monotonic()
        with self._lock:
            if now_s - self._newest.at_s > READING_COUNTS_S:
                self._hands.forget()
            self._hands.take(pad)
            silent = self._silence.take(pad, now_s)
            ended = silent and (self._hands.steering is not None or self._newest.silent)
            if ended:
                self._hands.forget()
            self._newest = _Reading(self._hands.steering, printable(name) if pad else "", now_s, ended)


def installed_reader() -> GamepadReader:
    """Returns a reader that has not started yet.

    Raises:
        UserError: SDL is not installed.
    """
    library()
    return GamepadReader()
