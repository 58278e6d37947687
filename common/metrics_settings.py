"""`metrics`: the part of a program's configuration that says where its metrics are served."""

from pydantic import Field

from common.addresses import is_loopback
from common.config import Section, SettingsConflictError
from common.listen_host import ListenHost


class MetricsSettings(Section):
    """The Prometheus endpoint: unencrypted and without authentication."""

    host: ListenHost = "127.0.0.1"
    port: int | None = Field(default=None, ge=0, le=65535)
    """None disables it; 0 takes any free port, which the log names."""
    insecure: bool = False
    """Accepts that others on the network can read the metrics; required for any address but loopback."""


def check_metrics(metrics: MetricsSettings) -> None:
    """Raises a SettingsConflictError if others on the network could read the metrics, and may not."""
    if metrics.port is not None and not is_loopback(metrics.host) and not metrics.insecure:
        raise SettingsConflictError(
            ("metrics", "host"),
            f"metrics.host is {metrics.host}: anyone on that network could read the metrics",
            "Use 127.0.0.1, or accept it with 'metrics: {insecure: true}'",
        )
