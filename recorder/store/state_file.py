"""What outlives a restart besides the recordings: answers of the last minutes, and measured rates."""

import logging
from pathlib import Path
from typing import Final

from pydantic import BaseModel, ConfigDict, ValidationError

from common.errors import InvalidRequestError
from recorder.store.folder import clear_temporaries, replace_file

_log = logging.getLogger(__name__)

REMEMBERED_S: Final = 600.0
_MAX_ANSWERS: Final = 10_000
_NAME: Final = "state.json"


class Answer(BaseModel):
    """What a request was answered; `at_s` are monotonic seconds of that boot of the computer."""

    model_config = ConfigDict(frozen=True)

    method: str
    recording_id: str
    message: str
    at_s: float
    boot_id: str = ""
    """Empty if unknown, as in files of former releases."""


class _Content(BaseModel):
    answers: dict[str, Answer] = {}
    with_video: dict[str, int] = {}
    without_video: dict[str, int] = {}
    """Bytes a minute by preset."""
    bytes_per_minute: dict[str, int] = {}
    """The same of former releases, which mixed both."""


class StateFile:
    """Answers by request ID, and bytes a minute by preset, with video and without.

    Ages are of the monotonic clock: the calendar may be set at any time.

    Args:
        root: the folder of recordings.
        boot_id: of the computer; empty if unknown.
    """

    def __init__(self, root: Path, boot_id: str = "") -> None:
        self._path = root / _NAME
        self._boot_id = boot_id
        self._content = _Content()

    def load(self) -> None:
        """Reads the file; one that is missing or damaged counts as empty."""
        try:
            clear_temporaries(self._path.parent)
            self._content = _Content.model_validate_json(self._path.read_bytes())
        except FileNotFoundError:
            return
        except (OSError, ValidationError) as error:
            _log.warning("%s can't be read, and begins anew: %s", self._path, error)

    def bytes_per_minute(self, preset: str, *, with_video: bool) -> int:
        """Returns what a preset took when it was last recorded so; 0 if it never was."""
        former = self._content.bytes_per_minute.get(preset, 0)
        return self._rates(with_video=with_video).get(preset, former)

    def answered(self, method: str, request_id: str, now_s: float) -> Answer | None:
        """Returns the answer to an earlier request with this ID; None if it is new.

        Args:
            method: that is requested.
            request_id: of the caller.
            now_s: monotonic seconds.

        Raises:
            InvalidRequestError: the ID was used for another method.
        """
        answer = self._content.answers.get(request_id)
        if answer is None or not self._is_remembered(answer, now_s):
            return None
        if answer.method != method:
            raise InvalidRequestError(
                f"request_id '{request_id}' was used for {answer.method}: make a new one for each action"
            )
        return answer

    def remember(self, request_id: str, answer: Answer) -> None:
        """Keeps an answer, and forgets those of more than 10 minutes ago."""
        kept = {
            each: old for each, old in self._content.answers.items() if self._is_remembered(old, answer.at_s)
        }
        while len(kept) >= _MAX_ANSWERS:
            del kept[next(iter(kept))]
        self._content.answers = {**kept, request_id: answer}

    def _is_remembered(self, answer: Answer, now_s: float) -> bool:
        # One of an earlier boot is older than this boot, which began at 0: it is remembered rather too long.
        age_s = now_s - answer.at_s if answer.boot_id == self._boot_id else now_s
        return age_s < REMEMBERED_S

    def measure(self, preset: str, bytes_per_minute: int, *, with_video: bool) -> None:
        """Keeps what a preset takes."""
        self._rates(with_video=with_video)[preset] = bytes_per_minute

    def _rates(self, *, with_video: bool) -> dict[str, int]:
        return self._content.with_video if with_video else self._content.without_video

    def write(self) -> None:
        """Writes the file.

        Raises:
            OSError: the disk is full or fails.
        """
        replace_file(self._path, self._content.model_dump_json().encode())
