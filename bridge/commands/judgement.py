"""What is to become of a command. Pure; the bytes come from the hub, and may be anything."""

import re
from collections.abc import Collection
from dataclasses import dataclass
from typing import Final

from google.protobuf.message import DecodeError

from common.printable import printable
from fleet.names import command_subject
from omniseer.fleet.v1 import command_pb2 as pb

MOST_BYTES: Final = 4096
LONGEST_EXPIRY_S: Final = 86_400
MOST_PRE_S: Final = 3600
MOST_POST_S: Final = 600
_COMMAND_ID: Final = re.compile(r"[A-Za-z0-9]{1,32}")
_RECORDING_ID: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,127}")
_ISSUER_CHARACTERS: Final = 64
_LABEL_CHARACTERS: Final = 100


@dataclass(frozen=True, slots=True)
class Upload:
    """Copies a recording to the hub."""

    recording_id: str


@dataclass(frozen=True, slots=True)
class Snapshot:
    """Makes a snapshot; None: as configured on the robot."""

    pre_s: int | None
    post_s: int | None
    label: str


@dataclass(frozen=True, slots=True)
class Request:
    """A command that may be handed to the gateway.

    Attributes:
        remaining_s: for how long it may still be begun.
    """

    command_id: str
    issued_by: str
    action: Upload | Snapshot
    remaining_s: float


@dataclass(frozen=True, slots=True)
class Denial:
    """A command that is answered at once, with REFUSED or EXPIRED."""

    command_id: str
    outcome: pb.CommandOutcome.ValueType
    message: str


@dataclass(frozen=True, slots=True)
class Stray:
    """A message that is no command to this robot; it has no answer."""

    why: str


Judgement = Request | Denial | Stray


def judge(
    subject: str, payload: bytes, *, robot: str, allowed: Collection[str], age_s: float | None
) -> Judgement:
    """Returns what is to become of a message of the stream of commands.

    Args:
        subject: of the message.
        payload: of the message.
        robot: this robot's name.
        allowed: actions that the configuration allows: "upload", "snapshot".
        age_s: how old it is at the most; None if that is in doubt.
    """
    command_id = subject.rpartition(".")[2]
    if subject != command_subject(robot, command_id) or not _COMMAND_ID.fullmatch(command_id):
        return Stray(f"its subject is {subject[:200]!r}")
    command = pb.Command()
    try:
        if len(payload) > MOST_BYTES:
            return _refused(command_id, f"a command has at most {MOST_BYTES} bytes")
        command.ParseFromString(payload)
    except DecodeError:
        return _refused(command_id, "the command can't be understood")
    if why := _invalid(command, command_id, robot):
        return _refused(command_id, why)
    action = _action(command, allowed)
    if isinstance(action, str):
        return _refused(command_id, action)
    return _in_time(command, action, age_s)


def _in_time(command: pb.Command, action: Upload | Snapshot, age_s: float | None) -> Request | Denial:
    command_id = command.command_id
    if age_s is None:
        return _expired(
            command_id, "how old the command is can't be known: the robot's clock is not synchronised"
        )
    if age_s >= command.expires_after_s:
        return _expired(
            command_id, f"the command is {age_s:.0f} s old; it was good for {command.expires_after_s} s"
        )
    issuer = printable(command.issued_by)[:_ISSUER_CHARACTERS]
    return Request(command_id, issuer, action, command.expires_after_s - age_s)


def _invalid(command: pb.Command, command_id: str, robot: str) -> str:
    """Returns what is wrong with what all commands have; empty if nothing is."""
    if command.command_id != command_id or command.robot != robot:
        return "the command is another one than its subject names"
    if not 1 <= command.expires_after_s <= LONGEST_EXPIRY_S:
        return f"expires_after_s is not from 1 to {LONGEST_EXPIRY_S}"
    return ""


def _action(command: pb.Command, allowed: Collection[str]) -> Upload | Snapshot | str:
    """Returns the action, or why it is refused."""
    name = command.WhichOneof("action")
    if name is None:
        return "there is no such command for robots"
    if name not in allowed:
        return f"this robot's bridge does not allow {name} (commands.allowed of its configuration)"
    if name == "upload":
        recording_id = command.upload.recording_id
        return Upload(recording_id) if _RECORDING_ID.fullmatch(recording_id) else "recording_id is impossible"
    wanted = command.snapshot
    pre_s = wanted.pre_s if wanted.HasField("pre_s") else None
    post_s = wanted.post_s if wanted.HasField("post_s") else None
    if (pre_s or 0) > MOST_PRE_S or (post_s or 0) > MOST_POST_S:
        return f"a snapshot has at most {MOST_PRE_S} s before and {MOST_POST_S} s after its request"
    return Snapshot(pre_s, post_s, printable(wanted.label)[:_LABEL_CHARACTERS])


def _refused(command_id: str, why: str) -> Denial:
    return Denial(command_id, pb.COMMAND_OUTCOME_REFUSED, why)


def _expired(command_id: str, why: str) -> Denial:
    return Denial(command_id, pb.COMMAND_OUTCOME_EXPIRED, why)
