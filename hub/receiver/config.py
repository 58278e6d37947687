"""Settings of the receiver: one YAML file, overridden by `RECEIVER__...` environment variables."""

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator
from pydantic_settings import SettingsConfigDict

from common.config import Section, Settings
from common.metrics_settings import MetricsSettings, check_metrics
from common.socket_path import SocketPath
from common.text_form import Form
from fleet.names import NAME_EXPECTED, ROBOT_NAME
from fleet.servers import exposed_server

_Name = Annotated[str, Form(ROBOT_NAME.pattern, NAME_EXPECTED)]


class HubSettings(Section):
    """The connection to the hub."""

    servers: tuple[Annotated[str, Field(max_length=255)], ...] = Field(min_length=1, max_length=16)
    """As "tls://host:4222"; all are nodes of one hub."""
    credentials: Path | None = None
    ca: Path | None = None
    """Authority of the servers' certificates. None connects without TLS, to this machine only: for tests."""

    @model_validator(mode="after")
    def _is_encrypted(self) -> Self:
        if server := exposed_server(self.servers, self.ca):
            raise ValueError(
                f"ca is missing, the file ca.pem of the hub: without it {server} can't be used, "
                "only nats:// to this machine"
            )
        return self


class StoreSettings(Section):
    """The S3-compatible store."""

    endpoint: str | None = Field(default=None, max_length=255)
    """As "https://store.example:9000"; None is Amazon S3."""
    public_endpoint: str | None = Field(default=None, max_length=255)
    """The same store as robots reach it, where that differs."""
    region: str = Field(default="us-east-1", max_length=64)
    bucket: str = Field(min_length=3, max_length=63)
    access_key: str = Field(max_length=128)
    secret_key_file: Path
    """Holds the secret of the access key, and nothing else."""
    ca: Path | None = None
    """Authority of the store's certificate. None: those of the system."""
    path_style: bool = True
    """Whether the bucket is in the path of a URL, not in its host."""


class ReceiverSettings(Settings):
    """All settings of a receiver."""

    model_config = SettingsConfigDict(env_prefix="RECEIVER__")

    fleet: _Name
    """Name of the fleet's account."""
    hub: HubSettings
    store: StoreSettings
    signing_key: Path
    """receipts.key of the hub."""
    receipt_keys: Path | None = None
    """receipts.pub of the hub, where other keys have signed before. None: the signing key's own."""
    keep_parts_days: int = Field(default=7, ge=1, le=365)
    """Parts of an upload that was begun so long ago, and not completed, are deleted."""
    socket: SocketPath = Path("/run/robot-receiver/receiver.sock")
    """Unix socket of the health service."""
    metrics: MetricsSettings = MetricsSettings()
    log_level: Literal["debug", "info", "warning", "error"] = "info"
    log_format: Literal["human", "json"] = "human"

    def check(self) -> None:
        """Raises a SettingsConflictError if others on the network could read the metrics, and may not."""
        check_metrics(self.metrics)
