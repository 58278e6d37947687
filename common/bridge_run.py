"""How the gateway recognises the bridge among its callers: by the run that the bridge has reported.

The bridge is an ordinary caller with a viewer's credential, and reports the ID of its run over a socket that
is the robot's own. It sends the same ID with its calls. That earns it a place for its copies, no permission.
"""

import hmac
from collections.abc import Iterable
from typing import Final

HEADER: Final = "x-bridge-run"
"""The metadata key."""


def is_of(run_id: str, metadata: Iterable[tuple[str, object]]) -> bool:
    """Returns whether a call with this metadata is of the bridge's run; never where none is known."""
    sent = next((value for key, value in metadata if key == HEADER and isinstance(value, str)), "")
    return bool(run_id) and hmac.compare_digest(sent.encode(), run_id.encode())
