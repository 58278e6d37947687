"""What is in the hub, as values: the one place of the console that knows the fleet's messages."""

from collections.abc import Iterator
from typing import Final

from common.printable import printable
from console.client import results
from console.client.mapping.events import event
from console.client.mapping.reader import read
from console.fleet import values
from fleet.enrolment import is_revoked
from fleet.reading import (
    NotReadableError,
    command_result,
    event_batch,
    robot_of,
    robot_state,
    stored_recording,
)
from omniseer.fleet.v1 import command_pb2, event_pb2
from omniseer.fleet.v1.upload_pb2 import StoredRecording as StoredRecordingMessage

_MOST_PERCENT: Final = 100


def state_of(key: str, payload: bytes) -> values.RobotState | values.Unreadable:
    """Returns the value of a key of the bucket of states."""
    try:
        message = robot_state(key, payload)
    except NotReadableError as error:
        return _unreadable(key, error)
    # A percentage beyond 100 is none.
    for name in ("battery_percent", "disk_used_percent"):
        if getattr(message, name) > _MOST_PERCENT:
            message.ClearField(name)
    return read(values.RobotState, message)


def items_of(subject: str, payload: bytes, received_unix_ms: int) -> Iterator[values.FleetItem]:
    """Yields what a message of the stream of events contains, in its order.

    Args:
        subject: Of the message.
        payload: Its content.
        received_unix_ms: When the hub took it, by the hub's clock.
    """
    try:
        batch = event_batch(subject, payload)
    except NotReadableError as error:
        yield _unreadable(robot_of(subject), error)
        return
    for item in batch.items:
        if item.WhichOneof("item") == "event":
            yield values.RobotEvent(
                robot=batch.robot, received_unix_ms=received_unix_ms, event=event(item.event)
            )
        else:
            yield _dropped(batch, item.dropped)


def recording_of(
    key: str, payload: bytes
) -> tuple[results.Recording, tuple[results.RecordingFile, ...], StoredRecordingMessage] | values.Unreadable:
    """Returns a stored recording, its files, and the message, whose receipt is still to be checked."""
    try:
        message = stored_recording(key, payload)
    except NotReadableError as error:
        return _unreadable(key.partition(".")[0], error)
    files = tuple(read(results.RecordingFile, file) for file in message.files)
    return read(results.Recording, message.recording), files, message


def answer_of(subject: str, payload: bytes) -> values.CommandAnswer | values.Unreadable:
    """Returns a robot's answer to a command."""
    try:
        message = command_result(subject, payload)
    except NotReadableError as error:
        return _unreadable(robot_of(subject), error)
    return read(values.CommandAnswer, message)


def snapshot_command(*, pre_s: int | None, post_s: int | None, label: str) -> command_pb2.Command:
    """Returns the command of a snapshot, without what `command_bytes` adds."""
    return command_pb2.Command(snapshot=command_pb2.SnapshotCommand(pre_s=pre_s, post_s=post_s, label=label))


def upload_command(recording_id: str) -> command_pb2.Command:
    """Returns the command to copy a recording to the hub's store, without what `command_bytes` adds."""
    return command_pb2.Command(upload=command_pb2.UploadCommand(recording_id=recording_id))


def command_bytes(
    action: command_pb2.Command,
    robot: str,
    *,
    command_id: str,
    issued_by: str,
    now_unix_ms: int,
    expires_s: int,
) -> bytes:
    """Returns the message of a command.

    Args:
        action: What to do.
        robot: Who is to do it.
        command_id: Names the command for ever.
        issued_by: The operator, for the robot's audit log.
        now_unix_ms: By the hub's clock.
        expires_s: How long it may still be begun.
    """
    head = command_pb2.Command(
        command_id=command_id,
        robot=robot,
        issued_by=issued_by,
        issued_unix_ms=now_unix_ms,
        expires_after_s=expires_s,
    )
    head.MergeFrom(action)
    return head.SerializeToString()


def _dropped(batch: event_pb2.EventBatch, message: event_pb2.DroppedEvents) -> values.EventsDropped:
    return read(values.EventsDropped, message, robot=batch.robot, run_id=printable(batch.run_id))


def _unreadable(robot: str, error: NotReadableError) -> values.Unreadable:
    return values.Unreadable(robot=printable(robot), problem=str(error))


def enrolment_of(key: str, payload: bytes, since_unix_ms: int) -> values.Enrolment:
    """Returns an entry of the bucket of enrolled robots, which the hub's administration writes.

    Args:
        key: The robot.
        payload: The entry.
        since_unix_ms: When it was written, by the hub's clock: at its enrolment, or its revocation.
    """
    return values.Enrolment(printable(key), is_revoked(payload), since_unix_ms)
