from common.errors import UserError
from console.receiver.errors import UndecodableError
from console.viewer.decoders import Decoders

UNDECODABLE = UndecodableError("it sends video/x-odd", "Look at the port", final=True)


def started(proven: dict[str, str]) -> Decoders:
    decoders = Decoders(proven.get)
    decoders.start()
    return decoders


def test_what_is_proven_is_chosen() -> None:
    assert started({"h264": "vah264dec"}).chosen() == {"h264": "vah264dec"}


def test_before_the_start_everything_is_software() -> None:
    assert Decoders(lambda _codec: "vah264dec").chosen() == {}


def test_a_failure_with_hardware_is_given_to_software_once() -> None:
    decoders = started({"h264": "vah264dec"})
    decoders.chosen()
    assert not decoders.after_undecodable(UNDECODABLE).final
    assert decoders.chosen() == {}
    assert decoders.after_undecodable(UNDECODABLE) is UNDECODABLE


def test_no_frame_at_all_falls_back_to_software_too() -> None:
    decoders = started({"h264": "vah264dec"})
    decoders.chosen()
    decoders.after_no_frame()
    assert decoders.chosen() == {}


def test_without_hardware_what_is_undecodable_stays_so() -> None:
    decoders = started({})
    decoders.chosen()
    assert decoders.after_undecodable(UNDECODABLE) is UNDECODABLE


def test_without_gstreamer_there_is_no_choice() -> None:
    def prove(_codec: str) -> str | None:
        raise UserError("no GStreamer")

    decoders = Decoders(prove)
    decoders.start()
    assert decoders.chosen() == {}
