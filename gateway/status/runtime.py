"""The gateway process as the status describes it."""

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class Runtime:
    """Build and counters of the running gateway.

    Attributes:
        revision: source revision of the build; empty if unknown.
        boot_id: the kernel's boot ID; empty if unknown.
        uptime_ms: since the gateway started.
        client_count: connections with a recent request.
        requests_served: calls answered since the start.
        requests_refused: calls refused since the start.
        run_id: unique for each start of the gateway; qualifies the sequence numbers of events.
    """

    revision: str
    boot_id: str
    uptime_ms: int
    client_count: int
    requests_served: int
    requests_refused: int
    run_id: str = ""


UNKNOWN: Final = Runtime("", "", 0, 0, 0, 0)
