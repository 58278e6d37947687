"""What steers robotctl drive: the keys of the terminal, a gamepad, or both."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from enum import Enum

from common.errors import UserError
from console.cli.drive_keys import Hands
from console.gamepad.reader import GamepadReader, installed_reader
from console.steering import Steering


class Input(Enum):
    """What steers."""

    AUTO = "auto"
    KEYBOARD = "keyboard"
    GAMEPAD = "gamepad"


class Controls:
    """The gamepad beside the keys. With both held, the gamepad steers.

    Args:
        choice: what was asked for.
        pad: the gamepad; None where none is read.
    """

    def __init__(self, choice: Input, pad: GamepadReader | None) -> None:
        self._choice, self._pad = choice, pad

    def steering(self, keys: Hands) -> tuple[Steering | None, str]:
        """Returns how the robot is steered, None while nothing is held; and what with, for the audit log."""
        if self._pad and (by_pad := self._pad.steering()):
            return by_pad, "gamepad"
        return None if self._choice is Input.GAMEPAD else keys.steering(time.monotonic()), "keyboard"

    def take_stop(self) -> bool:
        """Returns whether the gamepad's button for STOP was pressed since the last call.

        Raises:
            UserError: The gamepad is what was asked for, and can't be read.
        """
        if self._pad is None:
            return False
        if self._pad.error and self._choice is Input.GAMEPAD:
            raise self._pad.error
        return self._pad.take_stop()

    def release(self) -> None:
        """Releases the gamepad; what is still held counts only after it was let go."""
        if self._pad:
            self._pad.forget()

    def problem(self, keys: Hands) -> str:
        """Returns why what is held does not count any more; empty without such a reason."""
        if self._choice is not Input.GAMEPAD and not keys.answers(time.monotonic()):
            return "the terminal does not answer: a key counts when it does, and the key is pressed anew"
        return self._pad.problem() if self._pad else ""

    def warning(self, keys: Hands) -> str:
        """Returns what is to be known of the keys before driving; empty without anything of that kind."""
        if self._choice is Input.GAMEPAD or keys.ages_known:
            return ""
        return "old presses count: this terminal does not answer, so their age is not known"

    def advice(self) -> str:
        """Returns how to drive now."""
        pad = self._pad.name if self._pad else ""
        if self._choice is Input.GAMEPAD:
            return (
                f"hold a shoulder button of {pad} to drive, B stops, x ends" if pad else "plug a gamepad in"
            )
        also = f" or a shoulder button of {pad}" if pad else ""
        return f"hold w a s d{also} to drive, space stops, x ends"


@contextmanager
def controls(choice: Input) -> Iterator[Controls]:
    """Reads a gamepad while the block lasts, unless the keyboard alone is to steer.

    Raises:
        UserError: A gamepad is asked for, and SDL is not installed.
    """
    pad = _pad(choice)
    if pad:
        pad.start()
    try:
        yield Controls(choice, pad)
    finally:
        if pad:
            pad.close()


def _pad(choice: Input) -> GamepadReader | None:
    if choice is Input.KEYBOARD:
        return None
    try:
        return installed_reader()
    except UserError:
        if choice is Input.GAMEPAD:
            raise
        return None
