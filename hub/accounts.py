"""The hub's operator and its accounts: their keys, and the tokens that servers believe.

| account | what is in it |
|---|---|
| system | the administration, to give the servers these tokens |
| fleet | the streams, and the administration |
| robots | robots |
| people | people and programs that read |
| commanders | people that may send robots commands, too |
| receivers | receivers of recordings |

Only the account `fleet` stores anything. The others reach what they need of it, and of one another, by
services (hub/permissions.py).

An account's token also says which users' keys are revoked. A server keeps the newest it has seen, in its
configuration or on its own disk.
"""

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from common.errors import UserError
from common.private_files import write_all_private, write_private
from fleet.identity import Account, Key, KeyKind, account_jwt
from hub import permissions
from hub.directory import HubDirectory, KeyName
from hub.server_config import with_accounts

_KEYS: Final[dict[KeyName, KeyKind]] = {
    "operator": KeyKind.OPERATOR,
    "fleet": KeyKind.ACCOUNT,
    "robots": KeyKind.ACCOUNT,
    "people": KeyKind.ACCOUNT,
    "commanders": KeyKind.ACCOUNT,
    "receivers": KeyKind.ACCOUNT,
    "system": KeyKind.ACCOUNT,
}
_ACCOUNTS: Final[tuple[permissions.AccountName, ...]] = (*permissions.OTHERS, "system")
"""In the order in which servers get them: that of the system imports from all others."""
CONNECTIONS: Final[dict[permissions.AccountName, int]] = {
    "robots": 3072,
    "people": 256,
    "commanders": 256,
    "receivers": 64,
}
"""Together fewer than one server takes (hub/server_config.py), so that the administration finds a place at
each of them, whatever the owner of a stolen key takes. NATS has no limit for one user."""
_END_OF_TIME_S: Final = 253_402_300_799
"""The last second of the year 9999: servers refuse tokens that were issued until then."""


def new_account_keys() -> dict[KeyName, Key]:
    """Returns new keys of the operator and the accounts."""
    return {name: Key.new(kind) for name, kind in _KEYS.items()}


def add_accounts(directory: HubDirectory) -> None:
    """Makes the keys of the accounts that a hub of an earlier version lacks.

    Raises:
        UserError: one can't be written.
    """
    missing = directory.missing_accounts()
    write_all_private({directory.path / "keys" / f"{name}.nk": Key.new(_KEYS[name]).seed for name in missing})


def account_keys(directory: HubDirectory) -> dict[KeyName, Key]:
    """Returns the keys of the operator and the accounts.

    Raises:
        UserError: one can't be read.
    """
    return {name: directory.key(name) for name in _KEYS}


def account_tokens(
    keys: Mapping[KeyName, Key], fleet: str, revoked: Mapping[str, int], issued: int
) -> dict[str, str]:
    """Returns the tokens of the accounts, by public key, in the order in which servers get them.

    Args:
        keys: of `account_keys`.
        fleet: its name.
        revoked: public keys of users that are not valid any more.
        issued: when, in s since 1970; servers believe the newer one.
    """
    # A key is never used again, so whatever it has signed is revoked, also by a clock that was ahead.
    revoked = dict.fromkeys(revoked, _END_OF_TIME_S)
    table = permissions.IMPORTS
    accounts = {
        name: Account(
            {"system": name, "fleet": fleet}.get(name, f"{fleet} {name}"),
            stores=name == "fleet",
            # Several accounts may import the same.
            exports=tuple(dict.fromkeys(each for row in table.values() for each in row.get(name, ()))),
            imports=tuple(
                (keys[exporter].public, each)
                for exporter, services in table.get(name, {}).items()
                for each in services
            ),
            connections=CONNECTIONS.get(name, -1),
            revoked={} if name == "system" else revoked,
        )
        for name in _ACCOUNTS
    }
    return {
        keys[name].public: account_jwt(keys["operator"], keys[name].public, account, issued_unix_s=issued)
        for name, account in accounts.items()
    }


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
        tokens = account_tokens(
            account_keys(directory), record.fleet, record.revoked, record.issued or int(time.time())
        )
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
