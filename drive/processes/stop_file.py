"""What outlives the program, in one small file: a stop, the last one's number, an unrecorded motion, a lock.

A latched stop may have locked the robot's multiplexer, which stays locked when the program ends; and a person
who stops the robot does not mean "until the next restart". Numbers go on, so that a reset of an old stop
never meets a new one. A time of motion stays until a gateway has recorded it. A lock that a reset has left
active, because another program publishes it, too, is named until it is released.
"""

import json
import logging
import threading
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from common.backoff import Backoff
from common.errors import UserError
from common.private_files import make_own_directory, write_private
from drive.motion.episode import Episode
from drive.motion.values import Latch

_log = logging.getLogger(__name__)

_CLOSE_S: Final = 1.0
_FIRST_PAUSE_S: Final = 0.5
_LONGEST_PAUSE_S: Final = 30.0


@dataclass(frozen=True, slots=True)
class Stops:
    """What is known of stops.

    Attributes:
        last_id: number of the newest, reset or not. 0 before the first.
        latch: the stop in force; None without one.
        episode: a time of motion that has ended and that no gateway has recorded; None without one.
        lock_left: whether the multiplexer was locked for a stop, and is not known to be released since.
    """

    last_id: int = 0
    latch: Latch | None = None
    episode: Episode | None = None
    lock_left: bool = False

    @classmethod
    def from_json(cls, text: str | bytes) -> "Stops":
        """Returns the stops that `as_json` has described.

        Raises:
            ValueError, TypeError, KeyError: the text is no such description.
        """
        fields: Any = json.loads(text)
        latch = fields["latch"] and Latch(
            int(fields["latch"]["stop_id"]), str(fields["latch"]["by"]), str(fields["latch"]["reason"])
        )
        # Both are missing in files of earlier releases.
        episode = Episode(**fields["episode"]) if fields.get("episode") else None
        return cls(int(fields["last_id"]), latch or None, episode, bool(fields.get("lock_left")))

    def as_json(self) -> str:
        """Returns the description for the file and for the worker."""
        return json.dumps(asdict(self))


def read_stops(path: Path) -> Stops:
    """Returns what the file says; no stop if there is no file.

    A file that can't be read counts as a stop: doubt stops the robot.
    """
    try:
        return Stops.from_json(path.read_bytes())
    except FileNotFoundError:
        return Stops()
    except (OSError, ValueError, TypeError, KeyError) as error:
        return Stops(
            1, Latch(1, "robot-drive", f"{path} can't be read ({error}): there may have been a stop")
        )


class StopFile:
    """Writes stops in a thread of its own: a slow disk delays nothing. Only the newest counts.

    What the disk refuses is tried again, with pauses, until it takes it or something newer is to be written.

    Args:
        path: of the file; its directory is made this user's own.

    Raises:
        UserError: the directory can't be made.
    """

    def __init__(self, path: Path) -> None:
        try:
            make_own_directory(path.parent)
        except OSError as error:
            raise UserError(
                f"{path.parent} can't be used: {error.strerror}",
                "Set `state_dir` to a directory of this user",
            ) from error
        self._path = path
        self._changed = threading.Condition()
        self._newest = self._taken = read_stops(path)
        self._closed = False
        self._thread = threading.Thread(target=self._run, name="stop-file", daemon=True)
        self._thread.start()

    def keep(self, stops: Stops) -> None:
        """Queues the stops to be written, unless they are those that were written last."""
        if stops == self._newest:
            return  # The guard says so with each heartbeat; waking the thread would cost more than all else.
        with self._changed:
            self._newest = stops
            self._changed.notify()

    def close(self) -> None:
        """Waits until everything is written; a disk that hangs is given up."""
        with self._changed:
            self._closed = True
            self._changed.notify()
        self._thread.join(_CLOSE_S)

    def _run(self) -> None:
        backoff = Backoff(_FIRST_PAUSE_S, _LONGEST_PAUSE_S)
        pause_s: float | None = None
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._closed or self._newest != self._taken, pause_s)
                if self._closed and self._newest == self._taken:
                    return
                self._taken = self._newest
            try:
                write_private(self._path, self._taken.as_json().encode())
            except UserError as error:
                pause_s = backoff.next_s()
                _log.error("the stop would not outlive a restart (attempt %d): %s", backoff.failures, error)
            else:
                pause_s = None
                backoff.reset()
