"""SDL's gamepads: virtual ones of SDL's own, and a computer without SDL."""

import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import sdl2

from common.errors import UserError
from console.gamepad.hands import PadInput
from console.gamepad.reader import installed_reader
from console.gamepad.sdl import SdlPad
from tests.support.virtual_pad import VirtualPad, virtual_pad
from tests.support.waiting import wait_until


@pytest.fixture
def pad() -> Iterator[VirtualPad]:
    with virtual_pad() as pad:
        yield pad


@pytest.fixture
def place() -> Iterator[SdlPad]:
    place = SdlPad()
    yield place
    place.close()


def test_sticks_and_buttons_are_those_of_sdls_layout(pad: VirtualPad, place: SdlPad) -> None:
    assert place.read() == PadInput()
    pad.deflect(left_x=1.0, left_y=-1.0, right_x=0.5)
    pad.shoulder(down=True)
    found = read(place)
    assert found.sticks == pytest.approx((1.0, -1.0, -0.5), abs=1e-3)
    assert (found.shoulder, found.stop) == (True, False)
    pad.shoulder(down=False)
    pad.button(sdl2.SDL_CONTROLLER_BUTTON_B, down=True)
    assert (read(place).shoulder, read(place).stop) == (False, True)
    pad.button(sdl2.SDL_CONTROLLER_BUTTON_LEFTSHOULDER, down=True)
    assert read(place).shoulder, "either shoulder holds"


def test_whatever_changes_is_seen_and_no_cable_is_known_of(pad: VirtualPad, place: SdlPad) -> None:
    seen = {read(place).values}
    assert read(place).wireless
    pad.deflect(right_y=0.5)
    seen.add(read(place).values)
    pad.button(sdl2.SDL_CONTROLLER_BUTTON_DPAD_UP, down=True)
    seen.add(read(place).values)
    assert len(seen) == 3
    assert read(place).values in seen


@pytest.mark.usefixtures("pad")
@pytest.mark.parametrize(
    ("bus", "power", "wireless"),
    [
        (0x03, sdl2.SDL_JOYSTICK_POWER_UNKNOWN, False),
        (0x03, sdl2.SDL_JOYSTICK_POWER_WIRED, False),
        (0x03, sdl2.SDL_JOYSTICK_POWER_MEDIUM, True),
        (0x05, sdl2.SDL_JOYSTICK_POWER_UNKNOWN, True),
    ],
    ids=["USB", "USB, charging", "a receiver on USB", "Bluetooth"],
)
def test_a_cable_is_usb_without_a_battery(
    place: SdlPad, monkeypatch: pytest.MonkeyPatch, bus: int, power: int, wireless: bool
) -> None:
    monkeypatch.setattr(
        sdl2, "SDL_JoystickGetGUID", lambda _stick: sdl2.SDL_JoystickGUID((sdl2.Uint8 * 16)(bus))
    )
    monkeypatch.setattr(sdl2, "SDL_JoystickCurrentPowerLevel", lambda _stick: power)
    assert read(place).wireless is wireless


def read(place: SdlPad) -> PadInput:
    found = place.read()
    assert found, "there is a gamepad"
    return found


def test_one_that_is_unplugged_and_another_one(pad: VirtualPad, place: SdlPad) -> None:
    assert place.read() == PadInput()
    assert place.name
    pad.shoulder(down=True)
    pad.unplug()
    assert place.read() is None
    assert not place.name
    with virtual_pad():
        assert place.read() == PadInput()


def test_without_a_gamepad_there_is_none(place: SdlPad) -> None:
    assert place.read() is None


def test_a_reader_holds_from_a_shoulder_that_was_up_until_it_is_unplugged(pad: VirtualPad) -> None:
    pad.shoulder(down=True)
    reader = installed_reader()
    reader.start()
    try:
        wait_until(lambda: reader.name, "the gamepad is found")
        assert reader.steering() is None, "the button was down from the beginning"
        pad.shoulder(down=False)
        pad.button(sdl2.SDL_CONTROLLER_BUTTON_B, down=True)
        wait_until(reader.take_stop, "that was read")
        pad.shoulder(down=True)
        wait_until(lambda: reader.steering() is not None, "it holds")
        pad.unplug()
        wait_until(lambda: reader.steering() is None, "it is released")
    finally:
        reader.close()


def test_signals_stay_the_programs_own(place: SdlPad) -> None:
    place.read()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert sdl2.SDL_GetHint(sdl2.SDL_HINT_NO_SIGNAL_HANDLERS) == b"1"


def test_without_sdl_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "sdl2", None)
    with pytest.raises(UserError, match=r"SDL 2 and PySDL2.*not installed.*apt install libsdl2-2.0-0"):
        installed_reader()


def test_a_python_package_without_its_library_says_the_same(tmp_path: Path) -> None:
    """PySDL2 looks for the library when it is imported: in a process of its own."""
    program = (
        "import ctypes.util; ctypes.util.find_library = lambda name: None;"
        "from console.gamepad.reader import installed_reader; installed_reader()"
    )
    ran = subprocess.run(
        [sys.executable, "-c", program],
        env={"PYSDL2_DLL_PATH": str(tmp_path), "PATH": ""},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert "SDL 2 and PySDL2, which are not installed" in ran.stderr
