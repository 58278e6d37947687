"""What the hub's administrator does once it runs: enroll, revoke, list, purge.

| what happens | what follows |
|---|---|
| the hub is unreachable during `enroll` | the robot's files are not written; repeat it |
| `enroll` for an enrolled robot | refused, unless `again`: then new keys, and the old ones are revoked |
| a server is down during `revoke` | the others refuse the robot at once, it within 15 s of its start |
| a server is silent | another one is tried beside it after 1 s; what it led, until there is a leader again |
| a hub of an earlier version is administered | what needs people's accounts is refused until `apply` |
| nothing of the hub answers during `revoke` | the revocation is in the directory; `apply` repeats it |
| a server loses its disk | it knows the revocations of its nats.conf, and all after `apply` |
"""

import json
import time
from collections.abc import AsyncGenerator, Callable, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Final

from common.errors import UserError
from common.private_files import write_all_private
from fleet import names
from fleet.connection import Hub, connect
from fleet.errors import HubError, HubReason
from fleet.identity import Credentials, Permissions, new_user
from hub import permissions
from hub.accounts import account_keys, account_tokens, add_accounts
from hub.directory import HubDirectory, HubRecord, KeyName, Kind, User, check_name
from hub.jetstream import streams
from hub.jetstream.electing import once_elected

_CONNECT_S: Final = 5.0
"""For a connection with one of the servers; a silent one is no reason to wait (fleet/opening.py)."""
_PUSH_WITHIN_S: Final = 3.0


def move_people(directory: HubDirectory, name: Callable[[User], None]) -> None:
    """Gives a hub of an earlier version accounts of people's own, and ends the credentials for the other one.

    Those have rights in the account of the streams, by which their owners could delete what is in it. Servers
    learn of it from `apply`.

    Args:
        directory: the hub's.
        name: takes each person and receiver that needs new credentials, before the last step: where this is
            interrupted, the next attempt names them again.

    Raises:
        UserError: the directory is not a hub's, or can't be written.
    """
    with directory.locked():
        record, missing = directory.read(), directory.missing_accounts()
        people = [each for each in record.users if each.kind != "robot" and each.revoked is None]
        if missing:
            for user in people:
                record = _with_revoked(record, user.keys)
            # First: were it interrupted, it would be repeated as long as there are no keys.
            directory.write(record)
            add_accounts(directory)
        # A key in use that is revoked is of one who has been moved and may not have been named.
        moved = [each for each in people if each.keys[-1] in record.revoked]
        for user in moved:
            name(user)
            record = record.with_user(replace(user, revoked=_now_s()))
        if moved:
            directory.write(record)


async def apply(directory: HubDirectory, limits: streams.StreamLimits | None = None) -> list[str]:
    """Makes what is missing of streams, their room, buckets and consumers, and repeats all revocations.

    Returns:
        What differs in existing streams.

    Raises:
        UserError: the hub can't be reached, or refuses.
    """
    with directory.locked():
        record = directory.read()
        await _push_accounts(directory, record)
    async with _connected(directory) as hub:
        differences = await streams.set_up(hub, record.replicas, limits or streams.StreamLimits())
        for user in record.users:
            if user.kind == "robot":
                if not user.revoked:
                    await once_elected(partial(streams.add_command_consumer, hub, user.name))
                await _list_robot(hub, user)
    return differences


async def enroll(
    directory: HubDirectory, robot: str, out: Path, *, days: float | None = None, again: bool = False
) -> None:
    """Enrolls a robot and writes its files: bridge.creds, ca.pem, receipts.pub, fleet.yaml.

    Args:
        directory: the hub's.
        robot: its name.
        out: where its files go.
        days: of validity; None: until it is revoked.
        again: whether a robot of this name gets new keys, and the old ones are revoked.

    Raises:
        UserError: there is one of this name, or the hub can't be reached or refuses.
    """
    with directory.locked():
        record, creds = _issue(
            directory, "robot", robot, permissions.robot(robot), days, account="robots", again=again
        )
        user = record.user("robot", robot)
        assert user is not None  # noqa: S101  # it has just been issued
        async with _connected(directory) as hub:
            await once_elected(partial(streams.add_command_consumer, hub, robot))
            await _list_robot(hub, user)
        # First: a key that exists and is not listed could never be revoked.
        directory.write(record)
        write_all_private(
            {
                out / "bridge.creds": creds.text().encode(),
                out / "ca.pem": directory.secret("keys/ca.pem"),
                out / "receipts.pub": directory.secret("receipts.pub"),
                out / "fleet.yaml": _fragment(record, f"robot: {robot}\n"),
            }
        )
        if again:
            await _push_accounts(directory, record)


async def revoke(directory: HubDirectory, kind: Kind, name: str) -> None:
    """Makes all credentials of a user invalid; its connections are closed.

    Raises:
        UserError: there is no such user, or the hub can't be reached; the revocation is kept for `apply`.
    """
    with directory.locked():
        record = directory.read()
        user = record.user(kind, name)
        if user is None:
            raise UserError(f"the hub has no {kind} '{name}'", "List them: robot-bridge hub robots --all")
        user = replace(user, revoked=_now_s())
        record = _with_revoked(record.with_user(user), user.keys)
        await _push_accounts(directory, record)
        if kind == "robot":
            async with _connected(directory) as hub:
                await _list_robot(hub, user)


async def push_revocations(directory: HubDirectory) -> None:
    """Gives the servers all revocations; connections of who is revoked are closed.

    Raises:
        UserError: the hub can't be reached, or refuses; `apply` repeats it.
    """
    with directory.locked():
        await _push_accounts(directory, directory.read())


@dataclass(frozen=True, slots=True)
class HubUse:
    """What the hub's streams have.

    Attributes:
        streams: how full they are.
        events: messages with events by robot, the most first; one has up to 64 events.
    """

    streams: tuple[streams.StreamUse, ...]
    events: tuple[tuple[str, int], ...]


async def usage(directory: HubDirectory) -> HubUse:
    """Returns how full the streams are, and whose messages are in them.

    Raises:
        UserError, HubError: the hub can't be reached, or does not say.
    """
    robots = [user.name for user in directory.read().users if user.kind == "robot"]
    async with _connected(directory) as hub:
        uses = [await once_elected(partial(streams.use_of, hub, stream)) for stream in streams.REPORTED]
        counts = [
            (robot, await once_elected(partial(hub.count, names.EVENTS, names.event_subjects(robot))))
            for robot in robots
        ]
    return HubUse(tuple(uses), tuple(sorted(counts, key=lambda each: (-each[1], each[0]))))


async def purge(directory: HubDirectory, robot: str, *, recordings: bool) -> dict[str, int]:
    """Deletes what a robot has put into the streams; neither its state nor its files in the store.

    Args:
        directory: the hub's.
        robot: its name.
        recordings: whether its list of recordings is deleted, too.

    Returns:
        How many messages were deleted, by stream.

    Raises:
        UserError, HubError: there is no such robot, or the hub can't be reached or does not do it.
    """
    if directory.read().user("robot", robot) is None:
        raise UserError(f"the hub has no robot '{robot}'", "List them: robot-bridge hub robots")
    subjects = {names.EVENTS: names.event_subjects(robot), names.RESULTS: names.result_subject(robot, "*")}
    if recordings:
        subjects[f"KV_{names.RECORDINGS}"] = f"$KV.{names.RECORDINGS}.{robot}.>"
    async with _connected(directory) as hub:
        return {stream: await _purge(hub, stream, each) for stream, each in subjects.items()}


def operator_login(
    directory: HubDirectory, name: str, *, commands: bool, days: float | None, again: bool
) -> str:
    """Issues credentials for a person; returns the text that `robotctl fleet login` takes.

    Raises:
        UserError: there is one of this name.
    """
    with directory.locked():
        allowed = permissions.operator(commands=commands)
        account: KeyName = "commanders" if commands else "people"
        record, creds = _issue(directory, "operator", name, allowed, days, account=account, again=again)
        directory.write(record)
    keys = ", ".join(directory.secret("receipts.pub").decode().split())
    return (
        "# Robot Gateway fleet login 1\n"
        f"fleet: {record.fleet}\nname: {name}\nservers: {', '.join(record.servers)}\nreceivers: {keys}\n"
        f"credentials:\n{creds.text()}authority:\n{directory.secret('keys/ca.pem').decode()}"
    )


def operator_files(directory: HubDirectory, name: str, out: Path, *, days: float | None, again: bool) -> None:
    """Issues credentials for a program that reads as people do: operator.creds, ca.pem, fleet.yaml.

    Raises:
        UserError: there is one of this name, or the files can't be written.
    """
    with directory.locked():
        allowed = permissions.operator(commands=False)
        record, creds = _issue(directory, "operator", name, allowed, days, account="people", again=again)
        directory.write(record)  # First, as in `enroll`.
        write_all_private(
            {
                out / "operator.creds": creds.text().encode(),
                out / "ca.pem": directory.secret("keys/ca.pem"),
                out / "fleet.yaml": _fragment(record),
            }
        )


def receiver_files(directory: HubDirectory, name: str, out: Path, *, days: float | None, again: bool) -> None:
    """Issues credentials for receivers: receiver.creds, ca.pem, receipts.key, receipts.pub, fleet.yaml.

    Raises:
        UserError: there is one of this name.
    """
    with directory.locked():
        record, creds = _issue(
            directory, "receiver", name, permissions.receiver(), days, account="receivers", again=again
        )
        directory.write(record)  # First, as in `enroll`.
        write_all_private(
            {
                out / "receiver.creds": creds.text().encode(),
                out / "ca.pem": directory.secret("keys/ca.pem"),
                out / "receipts.key": directory.secret("receipts.key"),
                out / "receipts.pub": directory.secret("receipts.pub"),
                out / "fleet.yaml": _fragment(record),
            }
        )


def _issue(
    directory: HubDirectory,
    kind: Kind,
    name: str,
    allowed: Permissions,
    days: float | None,
    *,
    account: KeyName,
    again: bool,
) -> tuple[HubRecord, Credentials]:
    """Makes a user's credentials; returns them with the record that lists it."""
    check_name(name)
    record = directory.read()
    old = record.user(kind, name)
    if old is not None and not again:
        state = "was revoked" if old.revoked else "has credentials already"
        raise UserError(f"the {kind} '{name}' {state}", "Add --again for new ones; the old ones end")
    if old is not None:
        record = _with_revoked(record, old.keys)
    expires = None if days is None else int(time.time() + days * 86_400)
    creds, key = new_user(directory.key(account), name, allowed, expires)
    keys = (*(old.keys if old else ()), key)
    return record.with_user(User(name, kind, keys)), creds


def _with_revoked(record: HubRecord, keys: Sequence[str]) -> HubRecord:
    return replace(record, revoked={**record.revoked, **dict.fromkeys(keys, _now_s())})


def _now_s() -> int:
    """Returns the time as tokens have it, in s since 1970."""
    return int(time.time())


async def _push_accounts(directory: HubDirectory, record: HubRecord) -> None:
    """Keeps a record, and gives the servers the accounts' tokens, with all its revocations."""
    # Each later than the one before, also within a second, and after the clock was set back: a node that was
    # down would otherwise bring the others its older tokens, and with them who has been revoked meanwhile.
    record = replace(record, issued=max(_now_s(), record.issued + 1))
    directory.write(record)
    tokens = account_tokens(account_keys(directory), record.fleet, record.revoked, record.issued)
    async with _connected(directory, system=True) as hub:
        for token in tokens.values():
            answer = await hub.request("$SYS.REQ.CLAIMS.UPDATE", token.encode(), _PUSH_WITHIN_S)
            try:
                error = json.loads(answer).get("error")
            except (ValueError, AttributeError) as wrong:
                raise HubError(HubReason.INVALID, "the server's answer to a token is no JSON") from wrong
            if error:
                raise HubError(HubReason.INVALID, f"the server refuses an account's token: {error}")


async def _purge(hub: Hub, stream: str, subjects: str) -> int:
    """Deletes messages of a stream as soon as it has a leader; returns how many there were."""
    # By a call that is answered at once: a purge may take a minute, a second one would count what is left.
    await once_elected(partial(hub.stream_info, stream))
    return await streams.purge(hub, stream, subjects)


async def _list_robot(hub: Hub, user: User) -> None:
    """Puts a robot into the bucket that consoles read; raises a HubError, as `once_elected`."""
    entry = {"robot": user.name, "revoked": user.revoked is not None, "revoked_unix_s": user.revoked}
    await once_elected(partial(hub.put, names.ROBOTS, user.name, json.dumps(entry).encode()))


@asynccontextmanager
async def _connected(directory: HubDirectory, *, system: bool = False) -> AsyncGenerator[Hub, None]:
    """Yields a connection of the administration that stands."""
    async with connect(directory.address("system" if system else "admin")) as hub:
        await hub.connected(_CONNECT_S)
        yield hub


def _fragment(record: HubRecord, more: str = "") -> bytes:
    """Returns what a configuration file needs of the hub; names and addresses need no quotes in YAML."""
    servers = "".join(f"  - {server}\n" for server in record.servers)
    return f"servers:\n{servers}{more}fleet: {record.fleet}\n".encode()
