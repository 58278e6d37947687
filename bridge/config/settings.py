"""Settings of the bridge: one YAML file, overridden by `BRIDGE__...` environment variables."""

from pathlib import Path
from typing import Annotated, Final, Literal, Self

from pydantic import Field, field_validator, model_validator
from pydantic_settings import SettingsConfigDict

from bridge.config.uploads import UploadSettings
from common.config import Section, Settings
from common.errors import UserError
from common.socket_path import SocketPath
from common.text_form import Form
from console.target import DEFAULT_TARGET, parse_target
from fleet.names import NAME_EXPECTED, ROBOT_NAME
from fleet.servers import exposed_server

MIB: Final = 1024 * 1024
Name = Annotated[str, Form(ROBOT_NAME.pattern, NAME_EXPECTED)]
"""Of a robot or a fleet."""
Server = Annotated[
    str,
    Field(max_length=255),
    Form(r"(tls|nats)://[^\s/@]+", "a server without a login in it, tls://hub.example:4222 for example"),
]


class GatewaySettings(Section):
    """The robot's gateway, and a viewer's credential for it. Its files are read anew at each connection."""

    target: str = DEFAULT_TARGET
    """HOST or HOST:PORT."""
    login: Path | None = None
    """A login as `robot-gateway credentials add` prints it: all of the following in one file."""
    ca_certificate_file: Path | None = None
    """Of the authority that signed the gateway's certificate; with it the connection is encrypted."""
    client_certificate_file: Path | None = None
    client_key_file: Path | None = None
    token_file: Path | None = None

    @field_validator("target")
    @classmethod
    def _is_an_address(cls, target: str) -> str:
        try:
            return parse_target(target)
        except UserError as error:
            raise ValueError(error.what) from error

    @model_validator(mode="after")
    def _has_one_credential(self) -> Self:
        files = ("ca_certificate_file", "client_certificate_file", "client_key_file", "token_file")
        if self.login and (named := [name for name in files if getattr(self, name)]):
            raise ValueError(f"login has all that a connection needs: leave out {', '.join(named)}")
        return self


class HubSettings(Section):
    """The fleet's hub, as `robot-bridge hub enroll` writes it for the robot."""

    servers: tuple[Server, ...] = Field(default=("nats://127.0.0.1:4222",), min_length=1, max_length=16)
    """Nodes of the hub, in any order."""
    credentials: Path | None = None
    """The robot's bridge.creds. None: the hub asks for none, which it does in tests alone."""
    ca: Path | None = None
    """Certificate authority of the servers. None: without TLS, for servers on this machine."""
    receipts: Path | None = None
    """Public keys of the receivers of recordings."""
    robot: Name = "robot"
    """The name under which the robot is enrolled."""
    fleet: Name = "fleet"


class OutboxSettings(Section):
    """What waits for the hub."""

    max_bytes: int = Field(default=64 * MIB, ge=8 * MIB, le=4096 * MIB)
    """Of the outbox on the disk, all its files together, but for a damaged one that was moved aside."""


class CommandSettings(Section):
    """What the hub may request of this robot. The gateway's configuration has to allow it as well."""

    allowed: tuple[Literal["upload", "snapshot"], ...] = ()


class BridgeSettings(Settings):
    """All settings of the bridge."""

    model_config = SettingsConfigDict(env_prefix="BRIDGE__")

    socket: SocketPath = Path("/run/robot-gateway/bridge.sock")
    """Unix socket on which the gateway connects."""
    log_level: Literal["debug", "info", "warning", "error"] = "info"
    log_format: Literal["human", "json"] = "human"
    """Text for people, or one JSON object per line for programs."""
    root: Path = Path("/var/lib/robot-bridge")
    """The folder of the outbox."""
    gateway: GatewaySettings = GatewaySettings()
    hub: HubSettings = HubSettings()
    outbox: OutboxSettings = OutboxSettings()
    commands: CommandSettings = CommandSettings()
    uploads: UploadSettings = UploadSettings()
    advertised_target: str = Field(default="", max_length=255)
    """Where operators near the robot reach its gateway, as HOST:PORT, for the fleet's table."""

    @model_validator(mode="after")
    def _is_encrypted(self) -> Self:
        if server := exposed_server(self.hub.servers, self.hub.ca):
            raise ValueError(
                f"hub.ca is missing, the file ca.pem of the robot's enrolment: without it {server} can't be "
                "used, only nats:// to this machine, for tests"
            )
        return self
