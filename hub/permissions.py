"""Who may do what at the hub: one table. What is not named here, the servers refuse."""

from collections.abc import Mapping
from typing import Final, Literal

from fleet import names
from fleet.identity import Permissions, Service

AccountName = Literal["system", "fleet", "robots", "people", "commanders", "receivers"]
_READ: Final = (
    names.EVENTS,
    names.RESULTS,
    *(f"KV_{bucket}" for bucket in (names.STATES, names.RECORDINGS, names.ROBOTS)),
)
"""Streams for people. Not that of commands."""
_ANSWER_S: Final = 3600
"""A receiver reads a recording of many GB before its last answer."""

_UPLOADS: Final = Service(names.UPLOAD_SUBJECTS, many=True)
_READING: Final = Service(names.READING_SUBJECTS, many=True)
_OF_ROBOTS: Final = (
    Service(names.EVENT_SUBJECTS),
    Service(names.RESULT_SUBJECTS),
    Service(f"$KV.{names.STATES}.*"),
    # Under a name of its own: the robots' account, which stores nothing, answers JetStream's subject itself.
    Service(f"$JS.API.CONSUMER.INFO.{names.COMMANDS}.*", local="fleet.$1.time"),
    Service(f"$JS.API.CONSUMER.MSG.NEXT.{names.COMMANDS}.*", many=True),
    Service(f"$JS.ACK.{names.COMMANDS}.*.>"),
)
_OF_PEOPLE: Final = (
    *(Service(f"$JS.API.DIRECT.GET.{stream}", many=True) for stream in _READ),
    # As above.
    *(Service(f"$JS.API.STREAM.INFO.{stream}", local=names.info_subject(stream)) for stream in _READ),
)
OTHERS: Final[tuple[AccountName, ...]] = ("fleet", "receivers", "robots", "people", "commanders")
"""All accounts but the system's; those that export come first."""
IMPORTS: Final[Mapping[AccountName, Mapping[AccountName, tuple[Service, ...]]]] = {
    "robots": {"fleet": _OF_ROBOTS, "receivers": (_UPLOADS,)},
    "people": {"fleet": _OF_PEOPLE, "receivers": (_READING,)},
    "commanders": {"fleet": (*_OF_PEOPLE, Service(names.COMMAND_SUBJECTS)), "receivers": (_READING,)},
    "receivers": {"fleet": (Service(f"$KV.{names.RECORDINGS}.*.*"),)},
    "system": {each: (Service(f"hub.loaded.{each}"),) for each in OTHERS},
}
"""What each account may request of which other one.

All but the administration are in accounts without streams. Permissions say where a client may publish, not
where it may have the answer sent: the server itself publishes that, with all rights of the account. In the
account of the streams, a pull request with the reply subject $JS.API.STREAM.DELETE.fleet_events deletes that
stream (measured with 2.15.1). In these accounts no one takes that subject, nor fleet.<another robot>.ev.>.

None imports what makes a consumer: that delivers in the account of the streams, to a subject that its maker
says. People who may not send commands are in an account that does not import them.

No program serves or requests what the system account imports. A server loads that account, and with it those
it imports from, before it listens. Any other account it would load when the first client comes; if another
server of the cluster announces a subscription of the account in the same millisecond, the account can stay
marked as expired, and that server refuses all its clients until it gets a newer token (nats-server 2.15).
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
            *(f"$JS.API.DIRECT.GET.{stream}" for stream in _READ),
            *(names.info_subject(stream) for stream in _READ),
            names.READING_SUBJECTS,
            *((names.COMMAND_SUBJECTS,) if commands else ()),
        ),
        subscribe=("_INBOX.>",),
        payload=names.LARGEST_MESSAGE,
    )


def receiver() -> Permissions:
    """Returns the permissions of the receivers: they answer requests, and list what they have verified."""
    return Permissions(
        publish=(f"$KV.{names.RECORDINGS}.*.*",),
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
