"""Settings of the camera tap: one YAML file, overridden by `TAP__...` environment variables."""

from pathlib import Path
from typing import Literal

from pydantic import Field
from pydantic_settings import SettingsConfigDict

from common.config import Settings
from common.metrics_settings import MetricsSettings, check_metrics
from common.socket_path import SocketPath

MAX_FPS = 120


class TapSettings(Settings):
    """All settings of the camera tap. Which topics it takes is said by the preview's configuration."""

    model_config = SettingsConfigDict(env_prefix="TAP__")

    socket: SocketPath = Path("/run/robot-tap/tap.sock")
    """Unix socket on which the preview connects."""
    log_level: Literal["debug", "info", "warning", "error"] = "info"
    log_format: Literal["human", "json"] = "human"
    """Text for people, or one JSON object per line for programs."""
    max_fps: int = Field(default=60, ge=1, le=MAX_FPS)
    """Frames per second of each camera that are taken at the most; of more, the newest ones."""
    metrics: MetricsSettings = MetricsSettings()

    def check(self) -> None:
        """Raises a SettingsConflictError if others on the network could read the metrics, and may not."""
        check_metrics(self.metrics)
