"""The gateway program itself, as operators may know it."""

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class Runtime:
    """What changes while the gateway runs, and which build it is.

    Attributes:
        revision: of the source it was built from; empty when unknown.
        boot_id: another one after each start of the computer; empty when unknown.
        run_id: another one after each start of the gateway program; it numbers the events.
        client_count: connections that asked for something lately.
        requests_served: calls answered since the start.
        requests_refused: calls refused since the start.
    """

    revision: str
    boot_id: str
    uptime_ms: int
    client_count: int
    requests_served: int
    requests_refused: int
    run_id: str = ""


UNKNOWN: Final = Runtime("", "", 0, 0, 0, 0)
