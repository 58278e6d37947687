"""The servers' configuration (nats.conf), one per node; for nats-server 2.9 and later."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

_PRELOAD: Final = re.compile(r"^resolver_preload \{\n.*?^\}$", re.MULTILINE | re.DOTALL)
_LIMITS: Final = """\
# Limits. A robot has one connection; people and receivers a few. The accounts' own limits leave some over.
max_connections: 4096
max_payload: 1MB
max_pending: 16MB
max_subscriptions: 256
max_control_line: 4096
write_deadline: "5s"
# A half-open connection is found within 30 s.
ping_interval: "10s"
ping_max: 2
"""


@dataclass(frozen=True, slots=True)
class Node:
    """One server of the hub.

    Attributes:
        name: n1, n2, n3.
        host: by which clients and the other nodes reach it.
        port: for clients.
        cluster_port: for the other nodes.
        monitor: where its monitoring listens; it has no authentication.
    """

    name: str
    host: str
    port: int = 4222
    cluster_port: int = 6222
    monitor: str = "127.0.0.1:8222"


@dataclass(frozen=True, slots=True)
class Places:
    """Where a server finds its files, and where it listens.

    Attributes:
        config: directory of the configuration.
        data: directory of the streams and accounts.
        listen: address that it listens on.
    """

    config: str = "/etc/nats"
    data: str = "/var/lib/nats"
    listen: str = "0.0.0.0"  # noqa: S104  # inside a container; which address is published, its deployment says


def server_config(
    node: Node,
    nodes: Sequence[Node],
    *,
    operator: str,
    system_account: str,
    accounts: dict[str, str],
    places: Places,
    max_store: str,
    sync_always: bool,
) -> str:
    """Returns a node's nats.conf.

    Args:
        node: which.
        nodes: all of the cluster.
        operator: the operator's token.
        system_account: public key.
        accounts: tokens by public key, known from the beginning.
        places: its directories.
        max_store: disk space for streams, as "32GB".
        sync_always: whether a message is on the disk before it is acknowledged. nats-server 2.9 has no such
            setting: it syncs every two minutes.
    """
    sync = ", sync_interval: always" if sync_always else ""
    tls = (
        f'cert_file: "{places.config}/server.pem", key_file: "{places.config}/server.key",'
        f' ca_file: "{places.config}/ca.pem", timeout: 3'
    )
    text = f"""\
# Made by: robot-bridge hub init. A change here is lost when it is made again.
server_name: "{node.name}"
listen: "{places.listen}:{node.port}"
http: "{node.monitor}"

tls {{ {tls} }}

operator: {operator}
system_account: {system_account}
# At each interval nodes compare what they know of revocations: one that was down has missed some.
resolver {{ type: full, dir: "{places.data}/accounts", allow_delete: false, interval: "2s", limit: 100 }}
{_preload(accounts)}

# Each message is on the disk before it is acknowledged.
jetstream {{ store_dir: "{places.data}/jetstream", max_mem: 64MB, max_file: {max_store}{sync} }}

{_LIMITS}"""
    if len(nodes) > 1:
        routes = ", ".join(f'"nats-route://{each.host}:{each.cluster_port}"' for each in nodes)
        text += f"""
cluster {{
  name: hub
  listen: "{places.listen}:{node.cluster_port}"
  tls {{ {tls}, verify: true }}
  routes: [{routes}]
  no_advertise: true
}}
"""
    return text


def with_accounts(text: str, accounts: Mapping[str, str]) -> str:
    """Returns a node's nats.conf with other tokens of accounts; all else, changed by hand or not, stays.

    Args:
        text: of the file.
        accounts: tokens by public key.

    Raises:
        ValueError: the file has no such tokens.
    """
    replaced, count = _PRELOAD.subn(lambda _found: _preload(accounts), text)
    if count != 1:
        raise ValueError(f"it has {count} blocks resolver_preload, expected 1")
    return replaced


def _preload(accounts: Mapping[str, str]) -> str:
    lines = "\n".join(f"  {key}: {token}" for key, token in accounts.items())
    return f"resolver_preload {{\n{lines}\n}}"
