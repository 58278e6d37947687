"""The hub's list of robots: what the bucket of enrolled robots holds for each."""

import json


def is_revoked(entry: bytes) -> bool:
    """Returns whether an entry is of a robot whose credential is revoked."""
    try:
        found = json.loads(entry)
    except (ValueError, RecursionError):
        return False
    return isinstance(found, dict) and bool(found.get("revoked"))
