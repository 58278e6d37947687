"""A login that a pipe brings: the robot has issued it, and nothing else has it."""

import os
import select
import stat
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Final, Self, TextIO

from common.errors import UserError
from console.robots.login import parse_login

ENDS_WITHIN_S: Final = 30.0
"""Longest wait for the rest of a pipe, where only what was lost is to be named."""
_MOST_BYTES: Final = 1 << 16


class HasLoginError(UserError):
    """The robot of this name has a login already."""


@dataclass
class PipedLogin:
    """What a pipe brings, which can be read only once.

    Args:
        descriptor: Of its end.
        text: What was read of it; None before.
    """

    descriptor: int
    text: str | None = None

    @classmethod
    def of(cls, stream: TextIO) -> Self | None:
        """Returns the pipe that a stream reads from; None for any other: a file is still there afterwards."""
        try:
            descriptor = stream.fileno()
        except OSError:
            return None
        mode = os.fstat(descriptor).st_mode
        return cls(descriptor) if stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode) else None

    @contextmanager
    def accounted_for(self) -> Iterator[None]:
        """Adds to an error what becomes of the login: what was not read yet is read for that.

        Raises:
            UserError: The one that was raised inside.
        """
        try:
            yield
        except UserError as error:
            ended = True
            if self.text is None:
                self.text, ended = self._rest()
            self._account(error, ended=ended)
            raise

    def _account(self, error: UserError, *, ended: bool) -> None:
        taken = isinstance(error, HasLoginError)
        cause = f"{error.remedy}. " if error.remedy and not taken else ""
        again = f"repeat the whole pipe{', with --replace at its end' if taken else ''}"
        if issued := _issued_in(self.text or ""):
            error.what += "; the login in the pipe is not stored, but stays valid"
            error.remedy = (
                f"{cause}Type on the robot: robot-gateway credentials revoke {issued}; then {again}"
            )
        elif not ended:
            error.what += "; what the pipe still brings is not stored"
            error.remedy = (
                f"{cause}See on the robot what to revoke: robot-gateway credentials list; then {again}"
            )

    def _rest(self) -> tuple[str, bool]:
        """Returns what still comes in time, and whether the pipe has ended."""
        rest, until_s = b"", time.monotonic() + ENDS_WITHIN_S
        poll = select.poll()
        poll.register(self.descriptor, select.POLLIN)
        while len(rest) < _MOST_BYTES and (left_s := until_s - time.monotonic()) > 0:
            if not poll.poll(left_s * 1000):
                break
            part = os.read(self.descriptor, _MOST_BYTES)
            if not part:
                return rest.decode(errors="replace"), True
            rest += part
        return rest.decode(errors="replace"), False


def _issued_in(text: str) -> str:
    """Returns what revokes the login in a text; empty where it contains none."""
    try:
        return parse_login(text).revoked_by
    except UserError:
        return ""
