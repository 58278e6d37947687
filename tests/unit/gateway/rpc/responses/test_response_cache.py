from dataclasses import replace

from gateway.rpc.calls.recipient import Recipient
from gateway.rpc.mapping.status import overlay_snapshot, system_status
from gateway.rpc.responses.response_cache import REUSE_S, ResponseCache
from gateway.status.board import Board
from gateway.status.preview import Counters, Listener, PreviewState, PreviewView
from gateway.status.snapshot import Identity, Programs, Rules, Setup, Snapshot, take
from omniseer.gateway.v1.overlay_pb2 import OverlaySnapshot
from omniseer.gateway.v1.states_pb2 import PREVIEW_RUNNING
from omniseer.gateway.v1.system_status_pb2 import SystemStatus

ALICE, BOB = Recipient("10.0.0.1", sees_passphrase=False), Recipient("192.168.0.1", sees_passphrase=False)


class World:
    """A clock, a preview and a sampler that the test moves; counts how often it was looked at."""

    def __init__(self) -> None:
        self.now_s, self.taken = 100.0, 0
        self.ros_passed_s: float | None = None
        self.preview = PreviewView(
            PreviewState.DISABLED,
            None,
            "",
            True,
            Listener(7100, 125, "127.0.0.1"),
            None,
            None,
            None,
            Counters(),
        )
        self.cache = ResponseCache(self, lambda: self.now_s)

    def snapshot(self) -> Snapshot:
        self.taken += 1
        setup = Setup(Identity("lab", "1", insecure=False), Rules({}, 3000))
        return take(setup, Board(), Programs(self.preview), self.now_s)


def test_all_callers_in_time_get_the_same_bytes() -> None:
    world = World()
    first = world.cache.response(system_status, ALICE)
    world.now_s += REUSE_S * 0.9
    assert world.cache.response(system_status, ALICE) is first
    world.cache.response(overlay_snapshot, ALICE)
    assert world.taken == 1


def test_an_answer_is_never_older_than_promised() -> None:
    world = World()
    first = world.cache.response(system_status, ALICE)
    world.now_s += REUSE_S * 1.1
    assert world.cache.response(system_status, ALICE) is not first
    assert world.taken == 2


def test_a_changed_preview_is_seen_at_once() -> None:
    world = World()
    world.cache.response(system_status, ALICE)
    world.preview = replace(world.preview, state=PreviewState.RUNNING)
    status = SystemStatus.FromString(world.cache.response(system_status, ALICE))
    assert status.preview.state == PREVIEW_RUNNING
    overlay = OverlaySnapshot.FromString(world.cache.response(overlay_snapshot, ALICE))
    assert overlay.status == status


def test_what_the_sampler_has_read_is_seen_at_once() -> None:
    world = World()
    for passed_s in (100.0, 100.05):
        world.ros_passed_s = passed_s
        found = world.cache.response(system_status, ALICE)
        assert world.cache.response(system_status, ALICE) is found
    assert world.taken == 3, "at the start, and after each pass"


def test_a_pass_that_ends_while_a_snapshot_is_taken_makes_another_one() -> None:
    world = World()
    plainly = world.snapshot

    def passing() -> Snapshot:
        taken = plainly()
        world.ros_passed_s = 100.05
        return taken

    world.ros_passed_s, world.snapshot = 100.0, passing  # type: ignore[method-assign]
    world.cache.response(system_status, ALICE)
    world.cache.response(system_status, ALICE)
    assert world.taken == 3


def test_callers_from_different_networks_get_different_addresses() -> None:
    world = World()
    hosts = [
        SystemStatus.FromString(world.cache.response(system_status, caller)).preview.endpoint.host
        for caller in (ALICE, BOB, ALICE)
    ]
    assert hosts == ["10.0.0.1", "192.168.0.1", "10.0.0.1"]
