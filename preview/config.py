"""The preview service's settings: one YAML file, overridden by `PREVIEW__...` environment variables."""

import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Literal

from pydantic import Field, field_validator, model_validator
from pydantic_settings import SettingsConfigDict

from common.config import Section, Settings
from preview.encoders.catalogue import CATALOGUE, DEFAULT_ORDER
from preview.values import Codec, Profile, Target

MAX_WIDTH_PX = 3840
MAX_HEIGHT_PX = 2160
MAX_FPS = 120
MAX_BITRATE_KBPS = 100_000


class TestSource(Section):
    """A moving test picture, made here."""

    # Not a test, whatever pytest makes of the name.
    __test__ = False

    kind: Literal["test"] = "test"


class V4l2Source(Section):
    """A camera: by device node, or by the name of its card, because node numbers move."""

    kind: Literal["v4l2"] = "v4l2"
    device: str = ""
    card: str = ""
    fps: int | None = Field(default=None, gt=0, le=MAX_FPS)
    """What the camera runs at. None: as fast as the fastest profile asks for."""

    @model_validator(mode="after")
    def _one_of_both(self) -> "V4l2Source":
        if bool(self.device) == bool(self.card):
            raise ValueError("name either the device ('/dev/video11') or the card ('rkisp_mainpath')")
        return self


class FileSource(Section):
    """A video file, played at its own speed, again and again."""

    kind: Literal["file"] = "file"
    path: Path


class GstSource(Section):
    """Any GStreamer description that ends in raw video, "videotestsrc is-live=true" for example."""

    kind: Literal["gst"] = "gst"
    description: str = Field(min_length=1)


Source = Annotated[TestSource | V4l2Source | FileSource | GstSource, Field(discriminator="kind")]


class ProfileSettings(Section):
    """What a profile means on this robot."""

    width_px: int = Field(default=1280, ge=64, le=MAX_WIDTH_PX, multiple_of=2)
    height_px: int = Field(default=720, ge=64, le=MAX_HEIGHT_PX, multiple_of=2)
    fps: int = Field(default=30, ge=1, le=MAX_FPS)
    bitrate_kbps: int = Field(default=2500, ge=50, le=MAX_BITRATE_KBPS)
    floor_kbps: int = Field(default=500, ge=50, le=MAX_BITRATE_KBPS)
    """What the adaptive bit rate never goes below."""

    @model_validator(mode="after")
    def _floor_below_target(self) -> "ProfileSettings":
        if self.floor_kbps > self.bitrate_kbps:
            raise ValueError("floor_kbps must not be above bitrate_kbps")
        return self

    @property
    def target(self) -> Target:
        """The same for the pipeline."""
        return Target(self.width_px, self.height_px, self.fps, self.bitrate_kbps, self.floor_kbps)


class ProfilesSettings(Section):
    """The three profiles of the contract."""

    low_bw: ProfileSettings = ProfileSettings(fps=15, bitrate_kbps=1000, floor_kbps=300)
    balanced: ProfileSettings = ProfileSettings(fps=30, bitrate_kbps=2500, floor_kbps=500)
    high_quality: ProfileSettings = ProfileSettings(fps=60, bitrate_kbps=4500, floor_kbps=800)

    @property
    def targets(self) -> Mapping[Profile, Target]:
        """What each profile means."""
        return MappingProxyType(
            {
                Profile.LOW_BW: self.low_bw.target,
                Profile.BALANCED: self.balanced.target,
                Profile.HIGH_QUALITY: self.high_quality.target,
            }
        )


class SrtSettings(Section):
    """The listener that viewers call."""

    bind: str = "0.0.0.0"
    port: int = Field(default=7100, ge=1, le=65535)
    latency_ms: int = Field(default=125, ge=0, le=8000)
    """How long a viewer waits for a lost packet; the larger one of both sides counts."""
    key_length_bytes: Literal[16, 24, 32] = 16
    """AES key length where the gateway asks for encryption: 16 is AES-128, 32 is AES-256."""


class EncoderSettings(Section):
    """Which encoders may be used, and which first."""

    order: tuple[str, ...] = Field(default=DEFAULT_ORDER, min_length=1)
    codec: Literal["any", "h264", "h265"] = "any"
    """Restricts the choice: older viewers decode H.264 only."""
    key_frame_interval_s: float = Field(default=2.0, gt=0, le=30)
    """Longest distance between key frames; a viewer that joins gets one at once anyway."""
    probe_timeout_s: float = Field(default=6.0, gt=0, le=60)
    """How long one encoder may take to prove itself, the start of its process included."""
    forgive_after_s: float = Field(default=600.0, ge=0)
    """How long an encoder that failed in the pipeline is passed over."""

    @field_validator("order")
    @classmethod
    def _known(cls, order: tuple[str, ...]) -> tuple[str, ...]:
        for name in order:
            if name not in CATALOGUE:
                raise ValueError(f"'{name}' is not an encoder; known are {', '.join(CATALOGUE)}")
        if len(set(order)) != len(order):
            raise ValueError("an encoder is named twice")
        return order

    @model_validator(mode="after")
    def _something_left(self) -> "EncoderSettings":
        if not self.allowed:
            raise ValueError(f"no encoder in the order makes {self.codec}; add one, or allow 'any' codec")
        return self

    @property
    def allowed(self) -> tuple[str, ...]:
        """The order without what the codec rules out."""
        if self.codec == "any":
            return self.order
        return tuple(name for name in self.order if CATALOGUE[name].codec is Codec(self.codec))


class AdaptiveSettings(Section):
    """The bit rate follows what the viewers' links carry."""

    enabled: bool = False


class TimeoutSettings(Section):
    """How long things may take."""

    start_s: float = Field(default=5.0, gt=0, le=60)
    """From building the pipeline to its first picture from the source."""
    stop_s: float = Field(default=3.0, gt=0, le=60)
    """Tearing a pipeline down; past it the process ends."""
    source_silence_s: float = Field(default=1.5, gt=0, le=60)
    """Without a picture from the source while running."""
    encoder_silence_s: float = Field(default=1.0, gt=0, le=60)
    """Without an encoded picture while the source delivers."""
    without_gateway_s: float = Field(default=30.0, ge=0)
    """Without anybody watching the service: the preview stops by itself. 0: never."""


def _default_runtime_dir() -> Path:
    return Path(os.environ.get("XDG_RUNTIME_DIR") or tempfile.gettempdir()) / "robot-preview"


class PreviewSettings(Settings):
    """Everything the preview service can be told. The defaults suit the first robot."""

    model_config = SettingsConfigDict(env_prefix="PREVIEW__")

    socket: Path = Path("/run/robot-gateway/preview.sock")
    """The Unix socket the gateway speaks to."""
    log_level: Literal["debug", "info", "warning", "error"] = "info"
    log_format: Literal["human", "json"] = "human"
    """For people, or one JSON object a line for programs."""
    source: Source = Field(default_factory=lambda: V4l2Source(card="rkisp_mainpath"))
    profiles: ProfilesSettings = ProfilesSettings()
    srt: SrtSettings = SrtSettings()
    encoders: EncoderSettings = EncoderSettings()
    adaptive: AdaptiveSettings = AdaptiveSettings()
    timeouts: TimeoutSettings = TimeoutSettings()
    runtime_dir: Path = Field(default_factory=_default_runtime_dir)
    """Where a drawing of the last pipeline that failed is kept, and a note about encoders that hung.
    Best on a tmpfs."""
