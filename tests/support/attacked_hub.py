"""A hub that is attacked: connections without any wrapper, and what has to be as it was before."""

import time
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager

from fleet import names
from fleet.connection import FleetAddress, Hub, connect
from fleet.replies import parsed
from fleet.session import Session
from tests.support.secure_hub import SecureHub

_CONNECT_S = 10.0


@asynccontextmanager
async def connected(address: FleetAddress) -> AsyncGenerator[Hub, None]:
    """Yields a connection that stands."""
    async with connect(address) as hub:
        await hub.connected(_CONNECT_S)
        yield hub


@asynccontextmanager
async def thiefs_session(address: FleetAddress) -> AsyncGenerator[Session, None]:
    """The thief's own program: no wrapper keeps it from anything."""
    session = await Session.open(
        address.servers[0], credentials=address.credentials, ca=address.ca, inbox=address.inbox, name="thief"
    )
    try:
        yield session
    finally:
        await session.close()


async def store_with_status(session: Session, subject: str, status: str) -> None:
    """Stores a message whose headers begin as an answer of the hub does; its payload is its subject."""
    name, headers = subject.encode(), f"NATS/1.0 {status}\r\n\r\n".encode()
    with session.waiter(subject) as (waiter, reply):
        sizes = b"%d %d" % (len(headers), len(headers) + len(name))
        client = session._client._client
        await client._send_command(
            b"HPUB %s %s %s\r\n%s%s\r\n" % (name, reply.encode(), sizes, headers, name)
        )
        await client._flush_pending()
        assert "seq" in parsed((await waiter.get(_CONNECT_S)).payload)


async def put_marks(administrator: Hub) -> None:
    """Puts a command that waits for b, and a state of it."""
    await administrator.put(names.STATES, "b", b"mine")
    await administrator.publish_once(names.command_subject("b", "waits"), b"command")


@asynccontextmanager
async def unchanged(hub: SecureHub, bait: bytes | None = None) -> AsyncGenerator[None, None]:
    """Puts the marks, and fails where the block changes what the hub keeps of others than a.

    Args:
        hub: under attack.
        bait: payload of an event of a, for what would take it elsewhere; None: no event.
    """
    async with connected(hub.administrator()) as administrator:
        await put_marks(administrator)
        if bait is not None:
            await administrator.publish_once(names.event_subject("a", "bait", time.monotonic_ns()), bait)
        before = await everything(administrator)
        yield
        assert await everything(administrator) == before


async def everything(administrator: Hub) -> dict[str, object]:
    """What the hub keeps of b, and of everything that is not a's."""
    found: dict[str, object] = {}
    for stream in (names.EVENTS, names.RESULTS, names.COMMANDS):
        info = await administrator.api(f"STREAM.INFO.{stream}", {"subjects_filter": "fleet.b.>"})
        found[stream] = (info["state"].get("subjects"), info["state"]["consumer_count"])
    for bucket in (names.STATES, names.ROBOTS, names.RECORDINGS):
        entries = await administrator.entries(bucket)
        others = {key: each for key, each in entries.items() if key.partition(".")[0] != "a"}
        found[bucket] = {key: (each.value, each.revision) for key, each in others.items()}
        info = await administrator.api(f"STREAM.INFO.KV_{bucket}")
        found[f"consumers of {bucket}"] = info["state"]["consumer_count"]
    consumer = await administrator.api(f"CONSUMER.INFO.{names.COMMANDS}.b")
    found["consumer"] = (consumer["config"], consumer["num_pending"], consumer["num_ack_pending"])
    return found
