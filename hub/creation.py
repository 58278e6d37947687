"""Makes a hub: keys, certificates, and the configuration of its servers. Nothing of it needs a server.

One that is interrupted has left no hub.json, and can be repeated.
"""

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from common.ca import KeyPair, issue_node_certificate, new_ca
from common.errors import UserError
from common.private_files import write_all_private
from fleet.identity import Key, Permissions, new_user, operator_jwt
from fleet.receipt_keys import ReceiptSigner, as_text, new_seed
from hub import permissions
from hub.accounts import account_tokens, new_account_keys
from hub.directory import HubDirectory, HubRecord, KeyName, check_name
from hub.server_config import Node, Places, server_config

_CA_DAYS: Final = 3650.0
_SYSTEM: Final = Permissions(publish=("$SYS.REQ.CLAIMS.UPDATE",), subscribe=("_INBOX.>",))
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
    """Creates the hub's directory, and all that is in it.

    Raises:
        UserError: there is a hub in this directory or anything else, or it can't be written.
    """
    check_name(plan.fleet)
    with directory.locked():
        if directory.exists:
            raise UserError(f"{directory.path} has a hub already", "Choose another directory with --out")
        # In a checkout, the folder of this package has the name that comes to mind, and goes into images.
        if others := sorted({each.name for each in directory.path.iterdir()} - _MADE):
            raise UserError(
                f"{directory.path} has other files: {others[0]}", "Choose another directory with --out"
            )
        keys = new_account_keys()
        ca = new_ca(f"{plan.fleet} hub", _CA_DAYS)
        admin, _ = new_user(keys["fleet"], "administrator", permissions.administrator())
        system, _ = new_user(keys["system"], "administrator", _SYSTEM)
        seed = new_seed()
        root = directory.path
        issued = int(time.time())
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
        accounts=account_tokens(keys, plan.fleet, {}, issued),
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
