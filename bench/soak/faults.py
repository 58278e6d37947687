"""What goes wrong beside the rounds of the long run, one after the other."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Final

from bench.soak.deployment import ARM, Deployment
from console.client import CameraState, CloudState, GatewayClient
from tests.support.hostile import CONVERSATIONS, converse
from tests.support.waiting import wait_until

SEEN_WITHIN_S: Final = 15.0
SHOWN_WITHIN_S: Final = 30.0
"""A camera that has failed is tried again after so long at the latest."""
CONNECTED_WITHIN_S: Final = 90.0
"""The bridge's attempts at a hub that is lost again and again are a minute apart at the most."""
_SILENT: Final = "battery"

Fault = Callable[[Deployment, GatewayClient], AbstractContextManager[None]]
"""There while the block lasts. Where the status shows it, it is seen there before the block ends, and gone
after."""


@contextmanager
def no_fault(_robot: Deployment, _client: GatewayClient) -> Iterator[None]:
    """Nothing is wrong."""
    yield


@contextmanager
def silent_sensor(robot: Deployment, client: GatewayClient) -> Iterator[None]:
    """A topic has no messages."""
    robot.change_sensors(silent=[_SILENT])
    try:
        yield
        _wait_for_fault(client, active=True)
    finally:
        robot.change_sensors(silent=[])
    _wait_for_fault(client, active=False)


@contextmanager
def lost_camera(robot: Deployment, client: GatewayClient) -> Iterator[None]:
    """The publisher of a camera ends, and another one takes its place, which is shown."""
    robot.arm.stop()
    try:
        yield
        _wait_for_arm(client, CameraState.FAILED, SEEN_WITHIN_S)
    finally:
        robot.arm.start()
    client.enable_preview(camera=ARM)
    try:
        _wait_for_arm(client, CameraState.LIVE, SHOWN_WITHIN_S)
    finally:
        client.disable_preview()


@contextmanager
def lost_hub(robot: Deployment, client: GatewayClient) -> Iterator[None]:
    """The fleet's hub dies, and is started again."""
    robot.hub.kill(0)
    with _shown_until(client, CloudState.OFFLINE, robot.hub.start_all):
        yield


@contextmanager
def frozen_bridge(robot: Deployment, client: GatewayClient) -> Iterator[None]:
    """The bridge stands still; its connections stay open and silent."""
    robot.bridge.freeze()
    with _shown_until(client, CloudState.UNREACHABLE, robot.bridge.thaw):
        yield


@contextmanager
def full_outbox(robot: Deployment, client: GatewayClient) -> Iterator[None]:
    """The bridge's disk takes nothing more."""
    with robot.bridge.full_disk():
        yield
        _wait_for_cloud(client, CloudState.FAULTED, SEEN_WITHIN_S)
    _wait_for_cloud(client, CloudState.CONNECTED, CONNECTED_WITHIN_S)


@contextmanager
def killed_bridge(robot: Deployment, client: GatewayClient) -> Iterator[None]:
    """The bridge dies, and is started again."""
    robot.bridge.kill()
    with _shown_until(client, CloudState.UNREACHABLE, robot.bridge.start):
        yield


@contextmanager
def bad_callers(robot: Deployment, _client: GatewayClient) -> Iterator[None]:
    """Strangers send what no client would."""
    port = int(robot.target.rpartition(":")[2])
    for said in CONVERSATIONS.values():
        converse(port, said)
    yield


FAULTS: Final = (no_fault, silent_sensor, lost_camera, lost_hub, frozen_bridge, full_outbox, bad_callers)
"""Those of the long run: all programs live through it, so that what they keep adds up."""
DEATHS: Final = (killed_bridge,)
"""Those that end a program, and with it what it has kept: no part of the long run."""


@contextmanager
def _shown_until(client: GatewayClient, state: CloudState, repair: Callable[[], object]) -> Iterator[None]:
    """Waits until the status shows the state of the fleet's connection, repairs it, and waits for that."""
    try:
        yield
        _wait_for_cloud(client, state, SEEN_WITHIN_S)
    finally:
        repair()
    _wait_for_cloud(client, CloudState.CONNECTED, CONNECTED_WITHIN_S)


def _wait_for_fault(client: GatewayClient, *, active: bool) -> None:
    wait_until(
        lambda: any(_SILENT in each.id and each.active for each in client.status().faults) is active,
        f"the fault of the {_SILENT} is {'there' if active else 'gone'}",
        SEEN_WITHIN_S,
    )


def _wait_for_arm(client: GatewayClient, state: CameraState, within_s: float) -> None:
    def is_so() -> bool:
        arm = client.status().preview.camera(ARM)
        return arm is not None and arm.state is state

    wait_until(is_so, f"camera {ARM} is {state.value}", within_s)


def _wait_for_cloud(client: GatewayClient, state: CloudState, within_s: float) -> None:
    def is_so() -> bool:
        cloud = client.status().cloud
        return cloud is not None and cloud.state is state

    wait_until(is_so, f"the connection to the fleet is {state.value}", within_s)
