"""What the console reads of the hub, and the one thing that it writes: a command."""

import secrets
from collections.abc import AsyncIterator
from dataclasses import dataclass
from typing import Final

from console.fleet.board import FleetBoard
from console.fleet.receipts import check_receipt
from console.fleet.values import CommandAnswer, FleetItem, StoredRecording, Unreadable
from console.fleet.wire import answer_of, command_bytes, items_of, recording_of
from fleet import names
from fleet.clock import HubClock
from fleet.connection import Entry, Hub, Start, StoredMessage
from omniseer.fleet.v1.command_pb2 import Command

_MS_PER_S: Final = 1000
_ID_BYTES: Final = 8


async def read_board(hub: Hub) -> FleetBoard:
    """Returns the fleet at this moment.

    Raises:
        HubError: The hub does not answer.
    """
    board = FleetBoard()
    for entry in (await hub.entries(names.ROBOTS)).values():
        board.take_robot(entry)
    for entry in (await hub.entries(names.STATES)).values():
        board.take_state(entry)
    return board


async def read_recordings(
    hub: Hub, fleet: str, receivers: tuple[bytes, ...], robot: str = ""
) -> list[StoredRecording | Unreadable]:
    """Returns the recordings in the hub's store, the newest first, with their receipts checked.

    Args:
        hub: The hub.
        fleet: Name of the fleet, which a receipt has to have.
        receivers: Ed25519 public keys of the fleet's receivers, 32 bytes each.
        robot: One robot's; empty for all.

    Raises:
        HubError: The hub does not answer, or has more than is read at once.
    """
    found: list[StoredRecording | Unreadable] = []
    for key, entry in sorted((await recording_entries(hub, robot)).items()):
        read = recording_of(key, entry.value)
        if isinstance(read, Unreadable):
            found.append(read)
            continue
        recording, files, message = read
        robot = key.partition(".")[0]
        checked = check_receipt(message, fleet, robot, receivers)
        found.append(
            StoredRecording(
                robot=robot,
                recording=recording,
                files=files,
                receipt=checked.result,
                verified_unix_ms=checked.verified_unix_ms,
                location=checked.location,
            )
        )
    return sorted(found, key=_newest_first)


async def recording_entries(hub: Hub, robot: str) -> dict[str, Entry]:
    """Returns the hub's entries of recordings, by key: one robot's, or all.

    Raises:
        HubError: The hub does not answer, or has more than is read at once.
    """
    if robot and not names.ROBOT_NAME.fullmatch(robot):
        return {}  # What is no name would be a subject of anything.
    return await hub.entries(names.RECORDINGS, f"{robot}.>" if robot else ">")


async def recording_entry(hub: Hub, robot: str, recording_id: str) -> Entry | None:
    """Returns the hub's entry of one recording; None when there is none, or can be none.

    Raises:
        HubError: The hub does not answer.
    """
    if not (names.ROBOT_NAME.fullmatch(robot) and names.RECORDING_ID.fullmatch(recording_id)):
        return None  # As above.
    key = f"{robot}.{recording_id}"
    return (await hub.entries(names.RECORDINGS, key)).get(key)


@dataclass(frozen=True, slots=True)
class EventQuery:
    """Which events.

    Args:
        robot: One robot's; empty for all.
        since_unix_ms: Those that the hub took from then on, by its clock; None: new ones.
        follow: Whether new ones follow, for ever.
    """

    robot: str
    since_unix_ms: int | None
    follow: bool


async def read_events(hub: Hub, query: EventQuery) -> AsyncIterator[FleetItem]:
    """Yields events and gaps, in order for each robot, over all lost connections.

    Raises:
        HubError: The hub does not answer at the beginning.
    """
    subjects = f"fleet.{query.robot or '*'}.ev.>"
    newest = await hub.last(names.EVENTS, subjects)
    if newest is None and not query.follow:
        return
    if query.since_unix_ms is None:
        # By the number of the newest message, not by a clock: none is left out or shown twice at the border.
        start = Start.after(newest.sequence if newest else 0)
    else:
        start = Start.at(query.since_unix_ms / _MS_PER_S)
        if newest and not query.follow and newest.unix_s * _MS_PER_S < query.since_unix_ms:
            return
    async for message in hub.follow(names.EVENTS, subjects, start):
        for item in _items(message):
            yield item
        if newest and not query.follow and message.sequence >= newest.sequence:
            return


async def send_command(
    hub: Hub, clock: HubClock, robot: str, action: Command, *, issued_by: str, expires_s: int
) -> str:
    """Publishes a command and returns its ID, once the hub has it on its disks.

    Raises:
        HubError: It is not certain that the hub has it.
    """
    command_id = secrets.token_hex(_ID_BYTES)
    payload = command_bytes(
        action,
        robot,
        command_id=command_id,
        issued_by=issued_by,
        now_unix_ms=clock.unix_ms(),
        expires_s=expires_s,
    )
    await hub.publish_once(names.command_subject(robot, command_id), payload)
    return command_id


async def answer(hub: Hub, robot: str, command_id: str) -> CommandAnswer | Unreadable:
    """Returns a robot's answer to a command, whenever it comes: callers set a deadline."""
    subject = names.result_subject(robot, command_id)
    async for message in hub.follow(names.RESULTS, subject, Start.all()):
        return answer_of(message.subject, message.payload)
    raise AssertionError("a stream that is followed has no end")


def _items(message: StoredMessage) -> list[FleetItem]:
    return list(items_of(message.subject, message.payload, round(message.unix_s * _MS_PER_S)))


def _newest_first(item: StoredRecording | Unreadable) -> tuple[int, str]:
    started = 0 if isinstance(item, Unreadable) else item.recording.started_unix_ms
    return -started, item.robot
