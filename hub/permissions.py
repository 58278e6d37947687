"""Who may do what at the hub: one table. What is not named here, the servers refuse."""

from typing import Final

from fleet import names
from fleet.identity import Permissions, Service

_READ: Final = (
    names.EVENTS,
    names.RESULTS,
    *(f"KV_{bucket}" for bucket in (names.STATES, names.RECORDINGS, names.ROBOTS)),
)
"""Streams for people. Not that of commands: who may read it could change the robots' consumers, too."""
_ANSWER_S: Final = 3600
"""A receiver reads a recording of many GB before its last answer."""


SERVICES: Final = (
    Service(names.EVENT_SUBJECTS),
    Service(names.RESULT_SUBJECTS),
    Service(f"$KV.{names.STATES}.*"),
    Service(names.UPLOAD_SUBJECTS, many=True),
    # Under a name of its own: the robots' account, which stores nothing, answers JetStream's subject itself.
    Service(f"$JS.API.CONSUMER.INFO.{names.COMMANDS}.*", local="fleet.$1.time"),
    Service(f"$JS.API.CONSUMER.MSG.NEXT.{names.COMMANDS}.*", many=True),
    Service(f"$JS.ACK.{names.COMMANDS}.*.>"),
)
"""What the robots' account may request of the fleet's.

Robots have an account of their own, without streams. Permissions say where a client may publish, not where it
may have the answer sent: the server itself publishes that, with all rights of the account. In the account of
the streams, a pull request with the reply subject $JS.API.STREAM.DELETE.fleet_events deletes that stream
(measured with 2.15.1). In the robots' account no one takes that subject, nor fleet.<another robot>.ev.>.
"""


def robot(name: str) -> Permissions:
    """Returns the permissions of a robot: its own subjects, its own commands, its own inbox."""
    consumer = f"{names.COMMANDS}.{name}"
    return Permissions(
        publish=(
            f"fleet.{name}.ev.>",
            f"fleet.{name}.up.*",
            f"fleet.{name}.res.*",
            f"$KV.{names.STATES}.{name}",
            f"$JS.API.CONSUMER.MSG.NEXT.{consumer}",
            # Says what time it is at the hub, from 2.10 on: by it a robot knows how old a command is.
            f"fleet.{name}.time",
            f"$JS.ACK.{consumer}.>",
        ),
        subscribe=(f"{names.inbox_prefix(name)}.>",),
        subscriptions=16,
        payload=names.LARGEST_MESSAGE,
    )


def operator(*, commands: bool) -> Permissions:
    """Returns the permissions of people: they read what robots have reported, and their recordings.

    Args:
        commands: whether they may send robots commands, too.
    """
    return Permissions(
        publish=(
            *_reads(*_READ),
            names.READING_SUBJECTS,
            *((names.COMMAND_SUBJECTS,) if commands else ()),
        ),
        subscribe=("_INBOX.>",),
        payload=names.LARGEST_MESSAGE,
    )


def receiver() -> Permissions:
    """Returns the permissions of the receivers: they answer requests, and list what they have verified."""
    stream = f"KV_{names.RECORDINGS}"
    return Permissions(
        publish=(f"$KV.{names.RECORDINGS}.>", *_reads(stream)),
        subscribe=(
            "_INBOX.>",
            *(f"{each} {names.RECEIVERS}" for each in (names.UPLOAD_SUBJECTS, names.READING_SUBJECTS)),
        ),
        respond_s=_ANSWER_S,
        payload=names.LARGEST_MESSAGE,
    )


def administrator() -> Permissions:
    """Returns the permissions of the hub's administration: everything within the fleet's account."""
    return Permissions(publish=(">",), subscribe=(">",))


def _reads(*streams: str) -> tuple[str, ...]:
    """What reading a stream takes: a consumer of one's own, which the hub keeps in memory."""
    calls = ("STREAM.INFO.{}", "CONSUMER.CREATE.{}.>", "CONSUMER.MSG.NEXT.{}.*", "CONSUMER.DELETE.{}.*")
    return tuple(f"$JS.API.{call.format(stream)}" for stream in streams for call in calls)
