"""The hub's streams and buckets: one table, and how it is made so."""

import asyncio
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

from fleet import names
from fleet.connection import Hub
from fleet.errors import HubError, HubReason
from hub.jetstream.electing import once_joined

_DAY_NS: Final = 86_400 * 1_000_000_000
_MIB: Final = 1024 * 1024
_PURGED_WITHIN_S: Final = 60.0
"""Some millions of messages take seconds."""
JOINING_S: Final = 30.0
"""How long the nodes of a cluster that has just started may take to find each other."""


@dataclass(frozen=True, slots=True)
class StreamLimits:
    """What the streams may take; None: as much as they may already, or the default where one is made.

    Attributes:
        events_bytes: of events; when it is reached, robots keep theirs until older ones have expired.
        events_days: how long events and results are kept.
        recordings_bytes: of the list of recordings; when it is reached, it takes no further ones.
    """

    events_bytes: int | None = None
    events_days: int | None = None
    recordings_bytes: int | None = None

    def chosen(self, stream: str) -> dict[str, int]:
        """Returns the limits of a stream that are not None, in the form of JetStream's API."""
        max_age = self.events_days and self.events_days * _DAY_NS
        limits = {
            names.EVENTS: {"max_bytes": self.events_bytes, "max_age": max_age},
            names.RESULTS: {"max_age": max_age},
            f"KV_{names.RECORDINGS}": {"max_bytes": self.recordings_bytes},
        }.get(stream, {})
        return {key: value for key, value in limits.items() if value is not None}


EVENTS_BYTES: Final = 8192 * _MIB
EVENTS_DAYS: Final = 30
RECORDINGS_BYTES: Final = 1024 * _MIB
"""Defaults, which suit a hundred robots on one disk of 32 GB."""
_DEFAULTS: Final = StreamLimits(EVENTS_BYTES, EVENTS_DAYS, RECORDINGS_BYTES)


def stream_configs(replicas: int, limits: StreamLimits = StreamLimits()) -> dict[str, dict[str, Any]]:
    """Returns the configuration of every stream, by name, in the form of JetStream's API.

    Args:
        replicas: nodes that keep each message: 1, or 3 in a cluster.
        limits: what they may take.
    """
    once = {"max_msgs_per_subject": 1, "discard": "new", "discard_new_per_subject": True}
    days = EVENTS_DAYS * _DAY_NS
    streams = {
        names.EVENTS: _stream(names.EVENT_SUBJECTS, EVENTS_BYTES, days, once),
        names.RESULTS: _stream(names.RESULT_SUBJECTS, 256 * _MIB, days, once),
        # A command expires after a day at the latest.
        names.COMMANDS: _stream(names.COMMAND_SUBJECTS, 64 * _MIB, 2 * _DAY_NS, once),
        f"KV_{names.STATES}": _bucket(names.STATES, 256 * _MIB),
        f"KV_{names.RECORDINGS}": _bucket(names.RECORDINGS, RECORDINGS_BYTES),
        f"KV_{names.ROBOTS}": _bucket(names.ROBOTS, 64 * _MIB),
    }
    return {
        name: {"name": name, "num_replicas": replicas, **config, **limits.chosen(name)}
        for name, config in streams.items()
    }


async def set_up(hub: Hub, replicas: int, limits: StreamLimits = StreamLimits()) -> list[str]:
    """Makes the streams and buckets that are missing, and room in those that exist, where `limits` has more.

    Less room would cost messages, so it counts as a difference. Waits for nodes of a cluster that are still
    joining, JOINING_S in all; what it has begun by then, it ends.

    Returns:
        What differs in existing ones, as "fleet_events: max_bytes is 1, expected 2".

    Raises:
        HubError: the hub does not do it, or its servers run without JetStream.
    """
    deadline_s = asyncio.get_running_loop().time() + JOINING_S
    differences: list[str] = []
    for name, config in stream_configs(replicas, limits).items():
        make = partial(_make, hub, name, config, limits.chosen(name))
        try:
            differences += await once_joined(make, deadline_s)
        except HubError as error:
            raise HubError(error.reason, f"{name} can't be set up: {_meaning(error)}", error.code) from error
    return differences


@dataclass(frozen=True, slots=True)
class StreamUse:
    """How full a stream is.

    Attributes:
        stream: its name.
        size: bytes on the disk of each node that has it.
        most: bytes that it may have.
    """

    stream: str
    size: int
    most: int

    @property
    def ratio(self) -> float:
        """0: empty, 1: full."""
        return self.size / self.most if self.most > 0 else 0.0


_READABLE: Final = {"allow_direct": True}
"""People read by direct gets (fleet/direct.py). Hubs that were made before don't have it."""
REPORTED: Final = (names.EVENTS, names.RESULTS, f"KV_{names.RECORDINGS}")
"""Streams that robots fill, each in proportion to what it sends. When one is full, no robot can add to it."""


async def use_of(hub: Hub, stream: str) -> StreamUse:
    """Returns how full a stream is.

    Raises:
        HubError: the hub does not say.
    """
    info = await hub.stream_info(stream)
    try:
        return StreamUse(stream, int(info["state"]["bytes"]), int(info["config"]["max_bytes"]))
    except (KeyError, TypeError, ValueError) as error:
        raise HubError(HubReason.INVALID, f"the hub's answer about {stream} makes no sense") from error


async def purge(hub: Hub, stream: str, subjects: str) -> int:
    """Deletes the messages of a stream with such subjects; returns how many there were.

    Raises:
        HubError: the hub does not do it.
    """
    answer = await hub.api(f"STREAM.PURGE.{stream}", {"filter": subjects}, _PURGED_WITHIN_S)
    purged = answer.get("purged", 0)
    return purged if isinstance(purged, int) else 0


async def add_command_consumer(hub: Hub, robot: str) -> None:
    """Makes the durable consumer through which a robot reads its commands, if it does not exist.

    Raises:
        HubError: the hub does not do it.
    """
    subjects = names.command_subject(robot, "*")
    config = {
        "durable_name": robot,
        "name": robot,
        "filter_subject": subjects,
        "ack_policy": "explicit",
        "deliver_policy": "all",
        "ack_wait": 60 * 1_000_000_000,
        "max_ack_pending": 16,
    }
    call = f"CONSUMER.CREATE.{names.COMMANDS}.{robot}.{subjects}"
    await hub.api(call, {"stream_name": names.COMMANDS, "config": config})


async def _make(hub: Hub, name: str, config: dict[str, Any], chosen: Mapping[str, int]) -> list[str]:
    """Creates a stream if it is missing; else makes it readable and as large as chosen.

    Returns:
        What differs then.
    """
    try:
        info = await hub.api(f"STREAM.INFO.{name}")
    except HubError as error:
        if error.reason is not HubReason.MISSING:
            raise
        await hub.api(f"STREAM.CREATE.{name}", config)
        return []
    actual = info.get("config", {})
    grown = {key: value for key, value in chosen.items() if 0 < actual.get(key, 0) < value}
    changed = {**actual, **_READABLE, **grown}
    if changed != actual:
        await hub.api(f"STREAM.UPDATE.{name}", changed)
    # A limit that is not chosen now is as it was chosen before.
    free = _DEFAULTS.chosen(name).keys() - chosen.keys()
    expected = {key: value for key, value in config.items() if key not in free}
    return _differences(name, expected, changed)


def _meaning(error: HubError) -> str:
    """Returns what a refusal by the API of JetStream means, for people."""
    if error.reason is not HubReason.NO_RESPONDERS:
        return str(error)
    return f"{error}: its servers run without JetStream"


def _stream(subjects: str, max_bytes: int, max_age_ns: int, more: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "subjects": [subjects],
        "retention": "limits",
        "storage": "file",
        "max_bytes": max_bytes,
        "max_age": max_age_ns,
        "max_msg_size": names.LARGEST_MESSAGE,
        # Repeats are recognised by their subject, without a window of time.
        "duplicate_window": 1_000_000_000,
        "deny_delete": True,
        **_READABLE,
        **more,
    }


def _bucket(name: str, max_bytes: int) -> dict[str, Any]:
    """A key-value bucket, as the clients of NATS define it (ADR-8)."""
    return {
        "subjects": [f"$KV.{name}.>"],
        "retention": "limits",
        "storage": "file",
        "max_msgs_per_subject": 1,
        "max_bytes": max_bytes,
        "max_msg_size": names.LARGEST_MESSAGE,
        "discard": "new",
        # A robot's "Nats-Rollup: all" would delete the values of all others.
        "allow_rollup_hdrs": False,
        "deny_delete": True,
        "duplicate_window": 1_000_000_000,
        **_READABLE,
    }


def _differences(name: str, expected: Mapping[str, Any], actual: Mapping[str, Any]) -> list[str]:
    return [
        f"{name}: {key} is {actual.get(key)}, expected {value}"
        for key, value in expected.items()
        if actual.get(key) != value
    ]
