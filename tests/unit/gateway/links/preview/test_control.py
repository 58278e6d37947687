"""Answers to operators who switch the preview."""

import asyncio
import logging
from pathlib import Path

import pytest

from common.errors import InvalidRequestError
from gateway.links.link import ServiceLink
from gateway.links.preview.control import PreviewControl, PreviewLink
from gateway.links.preview.model import PreviewModel, PreviewReconciler
from gateway.links.preview.state import PreviewReport, PreviewSpec
from gateway.links.preview.wire import PreviewConnector
from gateway.links.reconciler import Reconciler
from gateway.status.preview import Camera, CameraState, Counters, PreviewState, Profile

OFF, ON = False, True


class Ground:
    """A preview whose service reports what the test says; no connection is made."""

    def __init__(self) -> None:
        model = PreviewModel(lambda _address: True, lambda: "made-up-passphrase")
        self.reconciler: PreviewReconciler = Reconciler(1000, model)
        self.link: PreviewLink = ServiceLink(
            "preview", PreviewConnector(Path("/nonexistent")), self.reconciler
        )
        self.control = PreviewControl(self.link, settle_s=5.0)

    def report(
        self,
        state: PreviewState,
        *,
        applied: bool = True,
        last_error: str = "",
        wanted: str = "",
        cameras: tuple[Camera, ...] = (),
    ) -> None:
        desired = self.link.desired
        self.reconciler.take_report(
            PreviewReport(
                "process-1",
                desired.revision if applied else 0,
                state,
                desired.spec.profile,
                last_error,
                None,
                None,
                None,
                None,
                Counters(),
                wanted,
                cameras,
            ),
            0.0,
        )

    async def set_mode(self, enabled: bool, profile: Profile | None = None, camera: str = "") -> str:
        """With a deadline so near that the answer is the state at this moment."""
        return await self.control.set_mode(enabled=enabled, profile=profile, remaining_s=0.1, camera=camera)


@pytest.fixture
def ground() -> Ground:
    ground = Ground()
    ground.report(PreviewState.DISABLED, applied=False)
    return ground


@pytest.mark.parametrize(
    ("enabled", "state", "answer"),
    [
        (ON, PreviewState.RUNNING, "preview is already running, balanced; nothing changed"),
        (ON, PreviewState.STARTING, "preview is not running yet (starting); check the status for progress"),
        (OFF, PreviewState.DISABLED, "preview is off"),
        (OFF, PreviewState.STOPPING, "preview is not off yet (stopping); check the status for progress"),
        (OFF, PreviewState.FAULTED, "preview could not be turned off: no camera"),
    ],
)
async def test_the_answer_to_a_request_that_was_made_before(
    ground: Ground, enabled: bool, state: PreviewState, answer: str
) -> None:
    await ground.set_mode(ON)
    if not enabled:
        await ground.set_mode(OFF)
    ground.report(state, last_error="no camera")
    before = ground.link.desired
    assert await ground.set_mode(enabled) == answer
    assert ground.link.desired is before


async def test_the_same_request_makes_a_faulted_preview_retry(ground: Ground) -> None:
    await ground.set_mode(ON)
    ground.report(PreviewState.FAULTED, last_error="no camera; plug one in")
    before = ground.link.desired
    answer = await ground.set_mode(ON)
    assert answer == "preview has failed and the robot keeps trying: no camera; plug one in"
    assert ground.link.desired.revision > before.revision
    assert ground.link.desired.spec == before.spec


async def test_without_the_service(ground: Ground) -> None:
    ground.reconciler.take_loss("nothing answers on its socket")
    assert await ground.set_mode(OFF) == (
        "preview is off; its service is unreachable and gets the request when it is back"
    )
    assert await ground.set_mode(ON) == (
        "preview has failed and the robot keeps trying: preview service unreachable (nothing answers on its"
        " socket). Start or restart it; the gateway reconnects by itself"
    )


async def test_the_robot_does_not_keep_trying_what_its_service_refuses(ground: Ground) -> None:
    answer = asyncio.ensure_future(ground.control.set_mode(enabled=ON, profile=None, remaining_s=None))
    await asyncio.sleep(0)
    ground.reconciler.take_refusal(ground.link.desired, "no encoder for this profile")
    ground.link.changes.notify_all()
    assert await answer == "preview service refused the request: no encoder for this profile"


def test_a_new_passphrase_is_logged_as_such(ground: Ground, caplog: pytest.LogCaptureFixture) -> None:
    ground.link.request(PreviewSpec(enabled=True, profile=Profile.BALANCED, passphrase="old"))
    with caplog.at_level(logging.INFO):
        ground.control.renew_passphrase()
    assert "new passphrase" in caplog.text
    assert ground.link.desired.spec.passphrase == "made-up-passphrase"


async def test_another_profile_is_a_new_request(ground: Ground) -> None:
    await ground.set_mode(ON, Profile.LOW_BW)
    ground.report(PreviewState.RUNNING)
    before = ground.link.desired
    await ground.set_mode(ON, Profile.HIGH_QUALITY)
    assert ground.link.desired.revision > before.revision
    ground.report(PreviewState.RUNNING)
    assert await ground.set_mode(ON, None) == "preview is already running, high-quality; nothing changed"


FRONT_LIVE = (Camera("front", CameraState.LIVE), Camera("rear", CameraState.READY))
REAR_STARTS = (Camera("front", CameraState.LIVE), Camera("rear", CameraState.STARTING))
REAR_LIVE = (Camera("front", CameraState.READY), Camera("rear", CameraState.LIVE))
REAR_BROKEN = (Camera("front", CameraState.LIVE), Camera("rear", CameraState.FAILED, "unplugged. Plug it in"))


def runs(ground: Ground, wanted: str, cameras: tuple[Camera, ...]) -> None:
    ground.report(PreviewState.RUNNING, wanted=wanted, cameras=cameras)


async def test_another_camera_is_a_new_request_that_settles_when_it_is_live(ground: Ground) -> None:
    await ground.set_mode(ON)
    runs(ground, "front", FRONT_LIVE)
    answer = asyncio.ensure_future(
        ground.control.set_mode(enabled=ON, profile=None, remaining_s=None, camera="rear")
    )
    await asyncio.sleep(0)
    assert str(ground.link.desired.spec) == "on, balanced, camera rear"
    runs(ground, "rear", REAR_STARTS)
    ground.link.changes.notify_all()
    await asyncio.sleep(0)
    assert not answer.done()
    runs(ground, "rear", REAR_LIVE)
    ground.link.changes.notify_all()
    assert await answer == "preview is running, balanced, camera rear"
    before = ground.link.desired
    nothing = "preview is already running, balanced, camera rear; nothing changed"
    assert await ground.set_mode(ON) == nothing
    assert await ground.set_mode(ON, camera="rear") == nothing
    assert ground.link.desired is before


async def test_a_camera_that_fails_is_named_and_tried_again_by_the_same_request(ground: Ground) -> None:
    await ground.set_mode(ON)
    runs(ground, "front", FRONT_LIVE)
    await ground.set_mode(ON, camera="rear")
    runs(ground, "rear", REAR_BROKEN)
    before = ground.link.desired
    assert ground.link.settled(before)
    answer = asyncio.ensure_future(
        ground.control.set_mode(enabled=ON, profile=None, remaining_s=None, camera="rear")
    )
    await asyncio.sleep(0)
    assert ground.link.desired.revision > before.revision
    runs(ground, "rear", REAR_BROKEN)
    ground.link.changes.notify_all()
    assert await answer == (
        "preview is running, but camera rear does not work; camera front is shown: unplugged. Plug it in"
    )


async def test_an_unknown_camera_is_refused_with_the_names(ground: Ground) -> None:
    runs(ground, "front", FRONT_LIVE)
    before = ground.link.desired
    with pytest.raises(InvalidRequestError, match=r"called 'back'; this robot has: front, rear") as refusal:
        await ground.set_mode(ON, camera="back")
    assert [violation.field for violation in refusal.value.violations] == ["camera"]
    with pytest.raises(InvalidRequestError) as refusal:
        await ground.set_mode(ON, camera="\x1b[2J" + "x" * 100)
    assert "\x1b" not in str(refusal.value)
    assert "x" * 65 not in str(refusal.value)
    assert ground.link.desired is before


async def test_a_service_that_is_too_old_for_cameras_says_so(ground: Ground) -> None:
    with pytest.raises(InvalidRequestError, match="older than the choice of a camera"):
        await ground.set_mode(ON, camera="rear")


async def test_without_the_service_a_camera_is_wanted_for_when_it_is_back(ground: Ground) -> None:
    ground.reconciler.take_loss("nothing answers on its socket")
    await ground.set_mode(ON, camera="rear")
    assert ground.link.desired.spec.camera == "rear"
    # It has been configured without that camera meanwhile: the preview comes back with the one it has.
    ground.report(PreviewState.DISABLED, applied=False, wanted="front", cameras=FRONT_LIVE[:1])
    assert ground.link.desired.spec.camera == ""
    assert ground.link.desired.spec.enabled


async def test_the_camera_is_kept_across_off(ground: Ground) -> None:
    runs(ground, "front", FRONT_LIVE)
    await ground.set_mode(ON, camera="rear")
    await ground.set_mode(OFF)
    await ground.set_mode(ON)
    assert ground.link.desired.spec.camera == "rear"


def test_a_new_gateway_takes_the_wanted_camera_over() -> None:
    ground = Ground()
    runs(ground, "rear", REAR_LIVE)
    assert ground.link.desired.spec.camera == "rear"
    assert (ground.link.view.wanted_camera, ground.link.view.cameras) == ("rear", REAR_LIVE)
    ground.reconciler.take_loss("gone")
    assert (ground.link.view.wanted_camera, ground.link.view.cameras) == ("", ())
