"""Each time of motion is recorded once, with its driver."""

import time
from dataclasses import replace

from gateway.status.event import ControlAction
from gateway.status.teleop import DriveEpisode
from gateway.teleop.episodes import Episodes
from gateway.teleop.lease import Driver

ANNA = Driver("anna", "anna", "10.0.0.9:4711", "operator", "cafe01")
BEN = Driver("ben", "ben", "10.0.0.8:4712", "admin", "cafe02", admin=True)


class Sink:
    def __init__(self) -> None:
        self.actions: list[ControlAction] = []

    def record_action(self, action: ControlAction) -> None:
        self.actions.append(action)


def ended(episode_id: int = 1, holder: str = "anna") -> DriveEpisode:
    """A motion that ends now."""
    now_ns = time.monotonic_ns()
    return DriveEpisode(episode_id, holder, now_ns - 2_500_000_000, now_ns, 0.25, 1.5, "released")


def test_it_says_who_how_long_how_far_and_why_it_ended() -> None:
    sink = Sink()
    episodes = Episodes(sink)
    episodes.note(ANNA, "gamepad")
    episodes.record("process", ended())
    (action,) = sink.actions
    assert (action.who, action.role, action.credential, action.address) == (
        "anna",
        "operator",
        "cafe01",
        "10.0.0.9:4711",
    )
    assert (action.method, action.request) == ("Drive", "2.5 s, 0.25 m, 86 deg, by gamepad")
    assert action.answer == "released"


def test_the_device_is_that_of_the_motion_and_not_of_the_hold_after_it() -> None:
    """The report of a motion's end may wait while the next hold arrives."""
    sink = Sink()
    episodes = Episodes(sink)
    for device in ("keyboard", "gamepad"):
        episodes.note(ANNA, device)
    motion = ended()
    episodes.note(ANNA, "monitor")
    episodes.record("process", motion)
    (action,) = sink.actions
    assert action.request.endswith("by gamepad")


def test_changes_of_device_displace_neither_a_motions_driver_nor_any_other() -> None:
    """The defect: each took the place of a driver, and a motion that was reported late had none."""
    sink = Sink()
    episodes = Episodes(sink)
    episodes.note(BEN, "gamepad")
    motions = [ended(1, "ben")]
    episodes.note(ANNA, "keyboard")
    motions.append(ended(2, "anna"))
    for number in range(1000):
        episodes.note(ANNA, ("gamepad", "monitor")[number % 2])
    for motion in motions:
        episodes.record("process", motion)
    assert [(each.who, each.role, each.credential) for each in sink.actions] == [
        ("ben", "admin", "cafe02"),
        ("anna", "operator", "cafe01"),
    ]
    assert sink.actions[0].request.endswith("by gamepad")
    assert " by " not in sink.actions[1].request, "its device is forgotten, and no later one is named"


def test_a_motion_is_of_the_credential_that_drove_and_not_of_a_later_one_of_that_name() -> None:
    sink = Sink()
    episodes = Episodes(sink)
    episodes.note(ANNA, "keyboard")
    motion = ended()
    episodes.note(replace(ANNA, credential="cafe03"), "gamepad")
    episodes.record("process", motion)
    (action,) = sink.actions
    assert action.credential == "cafe01"


def test_it_is_recorded_once_for_each_process() -> None:
    sink = Sink()
    episodes = Episodes(sink)
    first = ended()
    for instance, episode in (("a", first), ("a", first), ("a", ended(2)), ("b", ended(2))):
        episodes.record(instance, episode)
    assert len(sink.actions) == 3


def test_one_of_an_earlier_gateway_is_not_recorded_again() -> None:
    sink = Sink()
    earlier = ended()
    episodes = Episodes(sink)
    episodes.record("process", replace(earlier, ended_ns=earlier.ended_ns - 1))
    assert sink.actions == []


def test_one_that_an_earlier_gateway_did_not_live_to_record_is_recorded() -> None:
    sink = Sink()
    earlier = ended()
    episodes = Episodes(sink)
    lost = replace(earlier, ended_ns=earlier.ended_ns - 1, recorded=False)
    episodes.record("process", replace(lost, recorded=True))
    assert sink.actions == []
    for instance in ("process", "the next one, which reports it again"):
        episodes.record(instance, lost)
    (action,) = sink.actions
    assert (action.address, action.answer) == ("anna", "released")


def test_a_driver_without_a_name_is_an_address() -> None:
    sink = Sink()
    episodes = Episodes(sink)
    episodes.note(Driver("10.0.0.9", "10.0.0.9", "10.0.0.9:4711"), "")
    episodes.record("process", ended(holder="10.0.0.9"))
    (action,) = sink.actions
    assert (action.who, action.address, action.request) == ("", "10.0.0.9:4711", "2.5 s, 0.25 m, 86 deg")
