"""Which servers of a hub, and which stores, may be reached without TLS: those on the same machine."""

from collections.abc import Iterable
from pathlib import Path
from typing import Final
from urllib.parse import urlsplit

THIS_MACHINE: Final = frozenset({"127.0.0.1", "::1", "localhost"})
"""Hosts to which nothing passes a network."""


def exposed_server(servers: Iterable[str], ca: Path | None) -> str | None:
    """Returns a server that can't be used without an authority; None if there is none.

    With an authority, connections are encrypted whatever the scheme (`fleet.nats_client`). Without one, any
    server could pass for one that is called tls://, and others may read and change what goes to another
    machine.

    Args:
        servers: as "tls://host:4222" or "nats://host:4222".
        ca: authority of the servers' certificates.
    """
    if ca is not None:
        return None
    for server in servers:
        address = urlsplit(server)
        if address.scheme != "nats" or address.hostname not in THIS_MACHINE:
            return server
    return None
