"""Reads what robots have put into the hub: any bytes, from a robot or a thief of its key. All are checked."""

from typing import Final, TypeVar

from google.protobuf.message import DecodeError, Message

from fleet.names import LARGEST_MESSAGE, ROBOT_NAME
from omniseer.fleet.v1.command_pb2 import CommandResult
from omniseer.fleet.v1.event_pb2 import EventBatch, EventItem
from omniseer.fleet.v1.state_pb2 import RobotState
from omniseer.fleet.v1.upload_pb2 import StoredRecording, UploadResponse

LARGEST_STATE: Final = 64 * 1024
"""Bytes of a state; one with everything in it has about 4 KiB."""
LARGEST_ENTRY: Final = 4 * 1024 * 1024
"""Bytes of a recording's own entry in the store; a receiver makes none that is larger."""

MessageT = TypeVar("MessageT", bound=Message)


class NotReadableError(Exception):
    """A message is not what its place in the hub requires; the text says why, and quotes nothing of it."""


def robot_state(key: str, payload: bytes) -> RobotState:
    """Returns the value of a key of the bucket of states.

    Raises:
        NotReadableError: It is not a state of this robot.
    """
    state = _parsed(RobotState, payload, LARGEST_STATE)
    if state.robot != key:
        raise NotReadableError("the state is of another robot")
    return state


def stored_recording(key: str, payload: bytes) -> StoredRecording:
    """Returns the value of a key, ROBOT.RECORDING, of the bucket of recordings.

    Raises:
        NotReadableError: It is not this recording.
    """
    stored = _parsed(StoredRecording, payload, LARGEST_MESSAGE)
    robot, _, recording_id = key.partition(".")
    if not ROBOT_NAME.fullmatch(robot) or stored.recording.id != recording_id:
        raise NotReadableError("the entry is of another recording")
    return stored


def store_entry(payload: bytes) -> StoredRecording:
    """Returns the entry of a recording in the store, with all of its files.

    Raises:
        NotReadableError: It is none.
    """
    return _parsed(StoredRecording, payload, LARGEST_ENTRY)


def receiver_answer(payload: bytes) -> UploadResponse:
    """Returns a receiver's answer to a request.

    Raises:
        NotReadableError: It is none.
    """
    return _parsed(UploadResponse, payload, LARGEST_MESSAGE)


def event_batch(subject: str, payload: bytes) -> EventBatch:
    """Returns a batch of events, by its subject fleet.<robot>.ev.<run_id>.<first_sequence>.

    Raises:
        NotReadableError: It is not the batch that the subject names, or its items do not follow one another.
    """
    batch = _parsed(EventBatch, payload, LARGEST_MESSAGE)
    tokens = subject.split(".")
    if tokens[1:2] + tokens[3:] != [batch.robot, batch.run_id, str(batch.first_sequence)]:
        raise NotReadableError("the batch is of another robot or run than its subject")
    following = batch.first_sequence
    for item in batch.items:
        first, last = _sequences(item)
        if first != following or last < first:
            raise NotReadableError("the events of the batch do not follow one another")
        following = last + 1
    if not batch.items or following != batch.last_sequence + 1:
        raise NotReadableError("the batch does not have the events that it announces")
    return batch


def command_result(subject: str, payload: bytes) -> CommandResult:
    """Returns the answer to a command, by its subject fleet.<robot>.res.<command_id>.

    Raises:
        NotReadableError: It is another one's.
    """
    result = _parsed(CommandResult, payload, LARGEST_STATE)
    if subject.split(".")[1::2] != [result.robot, result.command_id]:
        raise NotReadableError("the answer is of another robot or to another command")
    return result


def robot_of(subject: str) -> str:
    """Returns the robot of a subject: its second token. Empty where there is none."""
    return (*subject.split("."), "", "")[1]


def _parsed(kind: type[MessageT], payload: bytes, largest: int) -> MessageT:
    if len(payload) > largest:
        raise NotReadableError(f"it is larger than {largest // 1024} KiB")
    try:
        return kind.FromString(payload)
    except DecodeError as error:
        raise NotReadableError("the bytes are no message of this kind") from error


def _sequences(item: EventItem) -> tuple[int, int]:
    match item.WhichOneof("item"):
        case "event":
            return item.event.sequence, item.event.sequence
        case "dropped":
            return item.dropped.first_sequence, item.dropped.last_sequence
        case _:
            raise NotReadableError("an item of the batch is neither an event nor a gap")
