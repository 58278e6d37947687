"""What outlives a restart besides the recordings: answers of the last minutes, and measured rates."""

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from pydantic import BaseModel, ConfigDict, ValidationError

from common.errors import InvalidRequestError
from recorder.store.folder import replace_file

_log = logging.getLogger(__name__)

REMEMBERED_S: Final = 600.0
_MAX_ANSWERS: Final = 10_000
_NAME: Final = "state.json"


class Answer(BaseModel):
    """What a request was answered. `at_s` is of the calendar clock, which outlives a restart."""

    model_config = ConfigDict(frozen=True)

    method: str
    recording_id: str
    message: str
    at_s: float


class _Content(BaseModel):
    answers: dict[str, Answer] = {}
    bytes_per_minute: dict[str, int] = {}


class StateFile:
    """Answers by request ID, and bytes a minute by preset.

    Args:
        root: the folder of recordings.
    """

    def __init__(self, root: Path) -> None:
        self._path = root / _NAME
        self._content = _Content()

    def load(self) -> None:
        """Reads the file; one that is missing or damaged counts as empty."""
        try:
            self._content = _Content.model_validate_json(self._path.read_bytes())
        except FileNotFoundError:
            return
        except (OSError, ValidationError) as error:
            _log.warning("%s can't be read, and begins anew: %s", self._path, error)

    @property
    def bytes_per_minute(self) -> Mapping[str, int]:
        """What each preset took when it was last recorded."""
        return self._content.bytes_per_minute

    def answered(self, method: str, request_id: str, now_s: float) -> Answer | None:
        """Returns the answer to an earlier request with this ID; None if it is new.

        Raises:
            InvalidRequestError: the ID was used for another method.
        """
        answer = self._content.answers.get(request_id)
        if answer is None or not 0 <= now_s - answer.at_s < REMEMBERED_S:
            return None
        if answer.method != method:
            raise InvalidRequestError(
                f"request_id '{request_id}' was used for {answer.method}: make a new one for each action"
            )
        return answer

    def remember(self, request_id: str, answer: Answer) -> None:
        """Keeps an answer, and forgets those of more than 10 minutes ago."""
        kept = {
            each: old
            for each, old in self._content.answers.items()
            if 0 <= answer.at_s - old.at_s < REMEMBERED_S
        }
        while len(kept) >= _MAX_ANSWERS:
            del kept[next(iter(kept))]
        self._content.answers = {**kept, request_id: answer}

    def measure(self, preset: str, bytes_per_minute: int) -> None:
        """Keeps what a preset takes."""
        self._content.bytes_per_minute[preset] = bytes_per_minute

    def write(self) -> None:
        """Writes the file.

        Raises:
            OSError: the disk is full or fails.
        """
        replace_file(self._path, self._content.model_dump_json().encode())
