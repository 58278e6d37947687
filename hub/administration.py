"""What the hub's administrator does: make a hub, enroll, revoke, list.

| what happens | what follows |
|---|---|
| `init` is interrupted | there is no hub.json: it can be repeated |
| the hub is unreachable during `enroll` | the robot's files are not written; repeat it |
| `enroll` for an enrolled robot | refused, unless `again`: then new keys, and the old ones are revoked |
| a server is down during `revoke` | the others refuse the robot at once, it within 15 s of its start |
| nothing of the hub answers during `revoke` | the revocation is in the directory; `apply` repeats it |
| a server loses its disk | it knows the revocations of its nats.conf, and all after `apply` |
"""

import asyncio
import json
import time
from collections.abc import AsyncGenerator, Mapping, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

from common.backoff import Backoff
from common.ca import KeyPair, issue_node_certificate, new_ca
from common.errors import ExitCode, UserError
from common.private_files import write_all_private, write_private
from fleet import names
from fleet.connection import Hub, connect
from fleet.errors import HubError, HubReason
from fleet.identity import (
    Account,
    Credentials,
    Key,
    KeyKind,
    Permissions,
    account_jwt,
    new_user,
    operator_jwt,
)
from fleet.receipt_keys import ReceiptSigner, as_text, new_seed
from hub import permissions, streams
from hub.directory import HubDirectory, HubRecord, KeyName, Kind, User
from hub.server_config import Node, Places, server_config, with_accounts

_CONNECT_S: Final = 5.0
_CA_DAYS: Final = 3650.0
_SYSTEM: Final = Permissions(publish=("$SYS.REQ.CLAIMS.UPDATE",), subscribe=("_INBOX.>",))
_PUSH_WITHIN_S: Final = 3.0
_ELECTED_WITHIN_S: Final = 15.0
"""A cluster that lost a server has a leader again by then (docs/fleet.md)."""
_MADE: Final = {"keys", "nodes", "admin.creds", "system.creds", "receipts.key", "receipts.pub"}
"""What an interrupted `create` leaves."""


@dataclass(frozen=True, slots=True)
class HubPlan:
    """What `create` makes.

    Attributes:
        fleet: its name.
        nodes: one, or three.
        places: directories on the servers.
        max_store: disk space for streams on each, as "32GB".
        sync_always: as `server_config`.
    """

    fleet: str
    nodes: tuple[Node, ...]
    places: Places = field(default_factory=Places)
    max_store: str = "32GB"
    sync_always: bool = True


def create(directory: HubDirectory, plan: HubPlan) -> None:
    """Creates keys, certificates and the servers' configuration. Nothing of it needs a server.

    Raises:
        UserError: there is a hub in this directory or anything else, or it can't be written.
    """
    if not names.ROBOT_NAME.fullmatch(plan.fleet):
        raise _no_name(plan.fleet)
    with directory.locked():
        if directory.exists:
            raise UserError(f"{directory.path} has a hub already", "Choose another directory with --out")
        # In a checkout, the folder of this package has the name that comes to mind, and goes into images.
        if others := sorted({each.name for each in directory.path.iterdir()} - _MADE):
            raise UserError(
                f"{directory.path} has other files: {others[0]}", "Choose another directory with --out"
            )
        keys = {name: Key.new(kind) for name, kind in _KEYS.items()}
        ca = new_ca(f"{plan.fleet} hub", _CA_DAYS)
        admin, _ = new_user(keys["fleet"], "administrator", permissions.administrator())
        system, _ = new_user(keys["system"], "administrator", _SYSTEM)
        seed = new_seed()
        root = directory.path
        issued = _now_s()
        files = {
            **{root / "keys" / f"{name}.nk": key.seed for name, key in keys.items()},
            root / "keys" / "ca.pem": ca.certificate,
            root / "keys" / "ca.key": ca.key,
            root / "admin.creds": admin.text().encode(),
            root / "system.creds": system.text().encode(),
            root / "receipts.key": as_text([seed]).encode(),
            root / "receipts.pub": as_text([ReceiptSigner(seed).public_key]).encode(),
        }
        for node in plan.nodes:
            files |= _node_files(root / "nodes" / node.name, node, plan, keys, ca, issued=issued)
        write_all_private(files)
        servers = tuple(f"tls://{node.host}:{node.port}" for node in plan.nodes)
        directory.write(HubRecord(plan.fleet, servers, replicas=len(plan.nodes), issued=issued))


async def apply(directory: HubDirectory, limits: streams.StreamLimits | None = None) -> list[str]:
    """Makes the streams and buckets that are missing, and repeats all revocations.

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
        record, creds = _issue(directory, "robot", robot, permissions.robot(robot), days, again=again)
        user = record.user("robot", robot)
        assert user is not None  # noqa: S101  # it has just been issued
        async with _connected(directory) as hub:
            await streams.add_command_consumer(hub, robot)
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


def refresh_nodes(directory: HubDirectory) -> list[str]:
    """Writes all revocations into the servers' configuration, as far as it is in the directory.

    A server reads it when it starts, and believes what is newer, it or its own disk: one that starts with an
    empty disk knows nothing else.

    Returns:
        Which files could not be changed, and why.

    Raises:
        UserError: the directory is not a hub's.
    """
    nodes = directory.path / "nodes"
    with directory.locked():
        record = directory.read()
        tokens = _account_tokens(_keys(directory), record.fleet, record.revoked, record.issued or _now_s())
        try:
            paths = sorted(each / "nats.conf" for each in nodes.iterdir())
        except FileNotFoundError:
            return []  # The servers have them, and no one else.
        except OSError as error:
            return [f"{nodes} can't be read: {error.strerror}"]
        return [problem for path in paths if (problem := _refresh(path, tokens))]


def _refresh(path: Path, tokens: Mapping[str, str]) -> str | None:
    """Changes one server's configuration; returns why that failed."""
    try:
        text = with_accounts(path.read_text(encoding="utf-8"), tokens)
        # For a container it belongs to the server, not to the administrator.
        write_private(path, text.encode(), keep_owner=True)
    except OSError as error:
        return f"{path} can't be read: {error.strerror}"
    except ValueError as error:
        return f"{path} is not as init makes it: {error}"
    except UserError as error:
        return error.what
    return None


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
        uses = [await streams.use_of(hub, stream) for stream in streams.REPORTED]
        counts = [(robot, await hub.count(names.EVENTS, names.event_subjects(robot))) for robot in robots]
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
        return {stream: await streams.purge(hub, stream, each) for stream, each in subjects.items()}


def operator_login(
    directory: HubDirectory, name: str, *, commands: bool, days: float | None, again: bool
) -> str:
    """Issues credentials for a person; returns the text that `robotctl fleet login` takes.

    Raises:
        UserError: there is one of this name.
    """
    with directory.locked():
        allowed = permissions.operator(commands=commands)
        record, creds = _issue(directory, "operator", name, allowed, days, again=again)
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
        record, creds = _issue(directory, "operator", name, allowed, days, again=again)
        directory.write(record)  # First, as in `enroll`.
        write_all_private(
            {
                out / "operator.creds": creds.text().encode(),
                out / "ca.pem": directory.secret("keys/ca.pem"),
                out / "fleet.yaml": _fragment(record),
            }
        )


def receiver_files(directory: HubDirectory, name: str, out: Path, *, days: float | None, again: bool) -> None:
    """Issues credentials for receivers: receiver.creds, ca.pem, receipts.key, fleet.yaml.

    Raises:
        UserError: there is one of this name.
    """
    with directory.locked():
        record, creds = _issue(directory, "receiver", name, permissions.receiver(), days, again=again)
        directory.write(record)  # First, as in `enroll`.
        write_all_private(
            {
                out / "receiver.creds": creds.text().encode(),
                out / "ca.pem": directory.secret("keys/ca.pem"),
                out / "receipts.key": directory.secret("receipts.key"),
                out / "fleet.yaml": _fragment(record),
            }
        )


_KEYS: Final[dict[KeyName, KeyKind]] = {
    "operator": KeyKind.OPERATOR,
    "fleet": KeyKind.ACCOUNT,
    "robots": KeyKind.ACCOUNT,
    "system": KeyKind.ACCOUNT,
}


def _keys(directory: HubDirectory) -> dict[KeyName, Key]:
    return {name: directory.key(name) for name in _KEYS}


def _account_tokens(
    keys: Mapping[KeyName, Key], fleet: str, revoked: Mapping[str, int], issued: int
) -> dict[str, str]:
    """Returns the tokens of the three accounts, by public key."""
    # A key is never used again, so whatever it has signed is revoked, also by a clock that was ahead.
    revoked = dict.fromkeys(revoked, _END_OF_TIME_S)
    services = permissions.SERVICES
    fleet_key = keys["fleet"].public
    accounts = {
        "system": Account("system"),
        "fleet": Account(fleet, stores=True, exports=services, revoked=revoked),
        "robots": Account(
            f"{fleet} robots", imports=tuple((fleet_key, each) for each in services), revoked=revoked
        ),
    }
    named = {name: keys[name] for name in _ACCOUNTS}
    return {
        key.public: account_jwt(keys["operator"], key.public, accounts[name], issued_unix_s=issued)
        for name, key in named.items()
    }


_ACCOUNTS: Final[tuple[KeyName, ...]] = ("system", "fleet", "robots")
_END_OF_TIME_S: Final = 253_402_300_799
"""The last second of the year 9999: servers refuse tokens that were issued until then."""


def _node_files(
    out: Path, node: Node, plan: HubPlan, keys: Mapping[KeyName, Key], ca: KeyPair, *, issued: int
) -> dict[Path, bytes]:
    certificate = issue_node_certificate(ca, node.name, [node.host, "localhost", "127.0.0.1"], _CA_DAYS)
    operator = keys["operator"]
    text = server_config(
        node,
        plan.nodes,
        operator=operator_jwt(operator, f"{plan.fleet} hub", keys["system"].public),
        system_account=keys["system"].public,
        accounts=_account_tokens(keys, plan.fleet, {}, issued),
        places=plan.places,
        max_store=plan.max_store,
        sync_always=plan.sync_always,
    )
    return {
        out / "nats.conf": text.encode(),
        out / "ca.pem": ca.certificate,
        out / "server.pem": certificate.certificate,
        out / "server.key": certificate.key,
    }


def _issue(
    directory: HubDirectory,
    kind: Kind,
    name: str,
    allowed: Permissions,
    days: float | None,
    *,
    again: bool,
) -> tuple[HubRecord, Credentials]:
    """Makes a user's credentials; returns them with the record that lists it."""
    if not names.ROBOT_NAME.fullmatch(name):
        raise _no_name(name)
    record = directory.read()
    old = record.user(kind, name)
    if old is not None and not again:
        state = "was revoked" if old.revoked else "has credentials already"
        raise UserError(f"the {kind} '{name}' {state}", "Add --again for new ones; the old ones end")
    if old is not None:
        record = _with_revoked(record, old.keys)
    expires = None if days is None else int(time.time() + days * 86_400)
    creds, key = new_user(directory.key("robots" if kind == "robot" else "fleet"), name, allowed, expires)
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
    tokens = _account_tokens(_keys(directory), record.fleet, record.revoked, record.issued)
    async with _connected(directory, system=True) as hub:
        for token in tokens.values():
            answer = await hub.request("$SYS.REQ.CLAIMS.UPDATE", token.encode(), _PUSH_WITHIN_S)
            try:
                error = json.loads(answer).get("error")
            except (ValueError, AttributeError) as wrong:
                raise HubError(HubReason.INVALID, "the server's answer to a token is no JSON") from wrong
            if error:
                raise HubError(HubReason.INVALID, f"the server refuses an account's token: {error}")


async def _list_robot(hub: Hub, user: User) -> None:
    """Puts a robot into the bucket that consoles read; while that elects its leader, tries again.

    Raises:
        HubError: nothing took it for _ELECTED_WITHIN_S.
    """
    entry = {"robot": user.name, "revoked": user.revoked is not None, "revoked_unix_s": user.revoked}
    retry, deadline_s = Backoff(0.1, 1.0), time.monotonic() + _ELECTED_WITHIN_S
    while True:
        try:
            await hub.put(names.ROBOTS, user.name, json.dumps(entry).encode())
        except HubError as error:
            if error.reason is not HubReason.NO_RESPONDERS or time.monotonic() > deadline_s:
                raise
            await asyncio.sleep(retry.next_s())
        else:
            return


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


def _no_name(name: str) -> UserError:
    return UserError(
        f"'{name[:80]}' is no name for a robot, person or fleet",
        "Write lower-case letters, digits and hyphens, at most 63, as in DNS names",
        exit_code=ExitCode.USAGE,
    )
