"""The gateway's settings: one YAML file, overridden by `GATEWAY__...` environment variables."""

import ipaddress
from collections import Counter
from pathlib import Path
from typing import Final, Literal, Self

from pydantic import Field, model_validator
from pydantic_settings import SettingsConfigDict

from common.config import Section, Settings, load
from common.errors import ExitCode, UserError
from gateway.fault_settings import FaultSettings
from gateway.status.board import SourceKind
from gateway.status.values import CommandSource

CONFIG_VARIABLE: Final = "ROBOT_GATEWAY_CONFIG"
"""Names the file where the command line does not."""


class SourceSettings(Section):
    """One ROS 2 topic the gateway reads."""

    kind: SourceKind
    label: CommandSource | None = None
    """Who commands through this input of the mux (mux_input only, and needed there)."""
    topic: str = Field(min_length=1)
    type: str = Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*/msg/[A-Za-z][A-Za-z0-9_]*$")
    reliability: Literal["best_effort", "reliable"] = "best_effort"
    durability: Literal["volatile", "transient_local"] = "volatile"
    stale_after_ms: int = Field(gt=0)
    required: bool = False
    """Whether the robot counts as degraded without this source (odometry and vision only)."""
    image_width_px: int = Field(default=1280, gt=0)
    """Width of the picture that detection boxes refer to (detections only); the messages don't tell."""
    image_height_px: int = Field(default=720, gt=0)
    """Height of the same picture."""
    max_items: int = Field(default=100, ge=1, le=1000)
    """How many detections of one picture are kept; all are counted."""

    @property
    def name(self) -> str:
        """Short and stable, for programs: "odometry", "mux_input.keyboard"."""
        return f"{self.kind.value}.{self.label.value}" if self.label else self.kind.value

    @model_validator(mode="after")
    def _label_the_mux_inputs_alone(self) -> Self:
        if (self.kind is SourceKind.MUX_INPUT) != (self.label is not None):
            labels = ", ".join(source.value for source in CommandSource)
            raise ValueError(f"a source of kind 'mux_input', and no other, has a label: {labels}")
        return self


DEFAULT_SOURCES = (
    SourceSettings(
        kind=SourceKind.ODOMETRY,
        topic="/odometry/filtered",
        type="nav_msgs/msg/Odometry",
        stale_after_ms=1000,
        required=True,
    ),
    SourceSettings(
        kind=SourceKind.VISION,
        topic="/vision/perf",
        type="omniseer_msgs/msg/VisionPerfSummary",
        stale_after_ms=2000,
        required=True,
    ),
    SourceSettings(
        kind=SourceKind.DETECTIONS,
        topic="/yolo/detections",
        type="yolo_msgs/msg/DetectionArray",
        stale_after_ms=500,
    ),
    SourceSettings(
        kind=SourceKind.BATTERY,
        topic="/battery",
        type="sensor_msgs/msg/BatteryState",
        stale_after_ms=5000,
    ),
    SourceSettings(
        kind=SourceKind.DIAGNOSTICS,
        topic="/diagnostics",
        type="diagnostic_msgs/msg/DiagnosticArray",
        stale_after_ms=5000,
    ),
    SourceSettings(
        kind=SourceKind.MUX_INPUT,
        label=CommandSource.KEYBOARD,
        topic="/cmd_vel_keyboard",
        type="geometry_msgs/msg/TwistStamped",
        stale_after_ms=500,
    ),
    SourceSettings(
        kind=SourceKind.MUX_INPUT,
        label=CommandSource.AUTONOMY,
        topic="/cmd_vel_autonomy",
        type="geometry_msgs/msg/TwistStamped",
        stale_after_ms=500,
    ),
    SourceSettings(
        kind=SourceKind.MUX_INPUT,
        label=CommandSource.NAVIGATION,
        topic="/cmd_vel_nav",
        type="geometry_msgs/msg/TwistStamped",
        stale_after_ms=500,
    ),
    SourceSettings(
        kind=SourceKind.EFFECTIVE_COMMAND,
        topic="/mecanum_drive_controller/reference",
        type="geometry_msgs/msg/TwistStamped",
        stale_after_ms=500,
    ),
)
"""Of the first robot. It tells no mode; a robot that does has one more source, of kind "mode"."""


class GrpcSettings(Section):
    """Where operators call."""

    host: str = Field(default="127.0.0.1", min_length=1)
    port: int = Field(default=50051, ge=0, le=65535)
    """0 takes any free one; the log tells which."""
    socket: Path | None = None
    """A Unix socket to serve on as well, for this machine's own health checks. Unencrypted; whoever asks for
    more than the health service needs a credential there, too."""


class TlsSettings(Section):
    """How connections are encrypted. Counts where there are credentials."""

    enabled: bool = True
    """False sends tokens and answers in the clear: on loopback alone, behind a tunnel."""
    certificate: Path | None = None
    """What the gateway shows (PEM, with the chain); by default the one that the credentials have."""
    key: Path | None = None
    """The certificate's key (PEM, its owner's alone)."""
    client_certificates: bool = False
    """Whether every caller must show a certificate."""
    client_ca: Path | None = None
    """Who signs these (PEM); by default the credentials' own authority."""

    @model_validator(mode="after")
    def _keep_pairs(self) -> Self:
        if (self.certificate is None) != (self.key is None):
            raise ValueError("certificate and key belong together: name both, or neither")
        if self.client_certificates and not self.enabled:
            raise ValueError("client_certificates need TLS: leave enabled at true")
        return self


class AuditSettings(Section):
    """Where control actions are recorded, besides the program's own log."""

    file: Path | None = None
    """JSON lines; by default audit.jsonl beside the credentials, and none where there are none."""
    max_kib: int = Field(default=1024, ge=4, le=1_048_576)
    """When a file is this long, a new one is begun."""
    generations: int = Field(default=4, ge=1, le=100)
    """Files that are kept, the newest included."""


class SecuritySettings(Section):
    """Who may call."""

    insecure: bool = False
    """Whether everybody on the way may listen in, and, without credentials, switch everything."""
    credentials: Path | None = None
    """What `robot-gateway credentials init` makes; with it, every caller proves who they are."""
    tls: TlsSettings = TlsSettings()
    audit: AuditSettings = AuditSettings()

    @property
    def guarded(self) -> bool:
        """Whether nobody gets in unknown, and nobody else can listen."""
        return self.credentials is not None and self.tls.enabled

    @model_validator(mode="after")
    def _need_credentials(self) -> Self:
        tls = self.tls
        if self.credentials is None and (tls.certificate or tls.client_certificates or tls.client_ca):
            raise ValueError("tls alone lets everybody in: name the directory of the credentials, too")
        return self


class MetricsSettings(Section):
    """What Prometheus may read: unencrypted, without asking who reads."""

    host: str = Field(default="127.0.0.1", min_length=1)
    port: int | None = Field(default=None, ge=0, le=65535)
    """None: no metrics. 0 takes any free one; the log tells which."""
    insecure: bool = False
    """Whether everybody who reaches the address may read them; any other than loopback needs it."""


class LimitSettings(Section):
    """What callers may have; who wants more is refused and told why."""

    connections: int = Field(default=256, ge=1, le=10_000)
    """How many may be served at once."""
    connections_per_address: int = Field(default=128, ge=1, le=10_000)
    """How many of them may come from one address: one computer can't take them all."""
    streams_per_connection: int = Field(default=16, ge=1, le=1000)
    requests_per_s: float = Field(default=500.0, gt=0)
    """How often one connection may ask in the long run."""
    burst: int = Field(default=1000, ge=1)
    """How many requests it may save up."""
    request_bytes: int = Field(default=131_072, ge=1024, le=262_144)
    """The longest request that is taken."""


class PreviewSettings(Section):
    """The way to the preview service, and from the viewers to its stream."""

    socket: Path = Path("/run/robot-gateway/preview.sock")
    settle_ms: int = Field(default=4000, ge=0, le=60_000)
    """How long a request to switch waits for the new state before it is answered with the present one."""
    advertised_host: str | None = Field(default=None, min_length=1)
    """The address viewers are sent to; by default the one by which the caller reached the gateway."""
    encrypted: bool | None = None
    """Whether each session gets a passphrase of its own; the preview's configuration says how strong. By
    default it does where callers prove who they are."""


class PlatformSettings(Section):
    """How the robot's computer is watched."""

    interval_ms: int = Field(default=1000, ge=100)
    stale_after_ms: int = Field(default=3000, gt=0)
    disk_path: Path = Path("/")
    """A path on the file system whose fill level counts."""
    interface: str | None = Field(default=None, min_length=1)
    """The network interface that leads to the operator; by default the one of the default route."""


class GatewaySettings(Settings):
    """Everything the gateway can be told. The defaults suit the first robot."""

    model_config = SettingsConfigDict(env_prefix="GATEWAY__")

    name: str = Field(default="robot-gateway", min_length=1, max_length=64)
    """What operators see as this robot's gateway."""
    log_level: Literal["debug", "info", "warning", "error"] = "info"
    log_format: Literal["human", "json"] = "human"
    """For people, or one JSON object a line for programs."""
    grpc: GrpcSettings = GrpcSettings()
    security: SecuritySettings = SecuritySettings()
    limits: LimitSettings = LimitSettings()
    preview: PreviewSettings = PreviewSettings()
    platform: PlatformSettings = PlatformSettings()
    faults: FaultSettings = FaultSettings()
    metrics: MetricsSettings = MetricsSettings()
    sources: tuple[SourceSettings, ...] = DEFAULT_SOURCES
    """None at all makes a gateway that needs no ROS."""

    @property
    def preview_encrypted(self) -> bool:
        """Whether the stream has a passphrase."""
        wanted = self.preview.encrypted
        return self.security.credentials is not None if wanted is None else wanted


def load_settings(path: Path | None) -> GatewaySettings:
    """Reads and checks the configuration, the parts alone and together.

    Raises:
        UserError: it can't be read, or something in it is wrong.
    """
    settings = load(GatewaySettings, path)
    _check_exposure(settings)
    _check_sources(settings)
    return settings


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach the address. A name other than localhost may lead anywhere."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


def _check_exposure(settings: GatewaySettings) -> None:
    security = settings.security
    if not (security.insecure or security.guarded or is_loopback(settings.grpc.host)):
        what = "everybody on that network could read and switch everything"
        if security.credentials is not None:
            what = "everybody on that network could read tokens and answers (security.tls.enabled is false)"
        raise UserError(
            f"grpc.host is {settings.grpc.host}: {what}",
            "Ask callers who they are ('robot-gateway credentials init' tells how), use 127.0.0.1 "
            "and a tunnel, or accept it with 'security: {insecure: true}'",
            exit_code=ExitCode.USAGE,
        )
    metrics = settings.metrics
    open_metrics = metrics.port is not None and not is_loopback(metrics.host)
    if open_metrics and not (security.insecure or metrics.insecure):
        raise UserError(
            f"metrics.host is {metrics.host}: everybody on that network could read the metrics",
            "Use 127.0.0.1, or accept it with 'metrics: {insecure: true}'",
            exit_code=ExitCode.USAGE,
        )


def _check_sources(settings: GatewaySettings) -> None:
    name, count = next(iter(Counter(source.name for source in settings.sources).most_common(1)), ("", 0))
    if count > 1:
        raise UserError(
            f"sources lists '{name}' {count} times",
            "Keep one topic for each kind, and one for each label of mux_input",
            exit_code=ExitCode.USAGE,
        )
