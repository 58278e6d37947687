"""A robot that has nothing but video: the real preview service behind the real gateway, each a process."""

import socket
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from console.client import DeadlineExceeded, GatewayClient, PreviewProfile, PreviewState, Unreachable
from tests.support.gateway_program import RestartableGateway
from tests.support.patient import PATIENT
from tests.support.running_preview import RunningPreview
from tests.support.waiting import wait_until

_UP_WITHIN_S = 20.0


@dataclass
class VideoGround:
    """Two programs.

    Args:
        preview: makes the video.
        gateway: what viewers ask for it.
    """

    preview: RunningPreview
    gateway: RestartableGateway

    @property
    def target(self) -> str:
        """The gateway's address."""
        return self.gateway.target

    def start_gateway(self) -> None:
        """Up when this returns."""
        self.gateway.start()
        wait_until(self._knows_the_preview, "the gateway is up", _UP_WITHIN_S)

    def switch_on(self, profile: PreviewProfile = PreviewProfile.BALANCED) -> None:
        """Frames leave when this returns."""
        with GatewayClient(self.target, PATIENT) as client:
            switch_on(client, profile)

    def switch_off(self) -> None:
        """The preview is off when this returns."""
        with GatewayClient(self.target, PATIENT) as client:
            assert client.disable_preview().preview.state is PreviewState.DISABLED

    def kill_preview(self) -> None:
        """The video's program dies without a word."""
        self.preview.process.kill()
        self.preview.process.wait()

    def _knows_the_preview(self) -> bool:
        # It may be up and not answer yet: its machine may stand still.
        with socket.socket() as probe, suppress(ConnectionRefusedError, Unreachable, DeadlineExceeded):
            probe.connect(("127.0.0.1", self.gateway.port))
            with GatewayClient(self.target) as client:
                return client.status().preview.service_reachable
        return False


def switch_on(client: GatewayClient, profile: PreviewProfile = PreviewProfile.UNKNOWN) -> None:
    """Turns the preview on; frames leave when this returns.

    On a machine that stands still a start may come too late, and is FAULTED until the next one.
    """
    change = client.enable_preview(profile)
    assert change.accepted, change

    def leave() -> bool:
        preview = client.status().preview
        as_asked = profile in (PreviewProfile.UNKNOWN, preview.profile)
        return preview.state is PreviewState.RUNNING and as_asked

    wait_until(leave, "frames leave", _UP_WITHIN_S)


@contextmanager
def video_ground(
    directory: Path,
    preview: Mapping[str, Any] | None = None,
    gateway: Mapping[str, Any] | None = None,
    *,
    cameras: Mapping[str, Any] | None = None,
    small: bool = True,
) -> Iterator[VideoGround]:
    """Up when the block begins; nothing is left when it ends.

    Args:
        directory: for everything both programs write.
        preview: keys of its configuration.
        gateway: keys of its configuration.
        cameras: devices to pretend, as of `RunningPreview`.
        small: frames of 320x240 instead of 1280x720.
    """
    with RunningPreview(directory, preview, cameras=cameras, small=small) as service:
        settings = {"sources": [], **(gateway or {})}
        settings["preview"] = {"socket": str(service.socket), **settings.get("preview", {})}
        ground = VideoGround(service, RestartableGateway(directory, settings))
        try:
            ground.start_gateway()
            yield ground
        finally:
            ground.gateway.kill()
