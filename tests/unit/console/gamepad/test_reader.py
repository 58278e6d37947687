"""The thread that reads a gamepad, with a device that the test plays."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from common.errors import UserError
from console.gamepad.hands import PadInput
from console.gamepad.reader import READING_COUNTS_S, GamepadReader
from console.gamepad.silence import HELD_FOR_S
from tests.support.waiting import wait_until

UP, HELD = PadInput(), PadInput(shoulder=True)


class PlayedDevice:
    """A gamepad; `hangs` holds its reads up."""

    name = "played \x1b[2J pad"

    def __init__(self) -> None:
        self.input: PadInput | None = PadInput()
        self.works = threading.Event()
        self.works.set()
        self.reads = 0
        self.closed_in = 0

    def read(self) -> PadInput | None:
        self.works.wait(10)
        self.reads += 1
        return self.input

    def close(self) -> None:
        self.closed_in = threading.get_ident()

    def seen(self) -> None:
        """Waits until what is set now was read."""
        before = self.reads
        wait_until(lambda: self.reads > before + 1, "it is read")


@contextmanager
def reading(device: PlayedDevice) -> Iterator[GamepadReader]:
    reader = GamepadReader(lambda: device)
    reader.start()
    try:
        device.seen()
        yield reader
    finally:
        device.works.set()
        reader.close()


def is_held(device: PlayedDevice, reader: GamepadReader, held: PadInput, up: PadInput = UP) -> bool:
    """Presses anew where need be: a machine that holds the reading thread up for a moment is a release."""
    if reader.steering() is None:
        for device.input in (up, held):
            device.seen()
    return reader.steering() == (0, 0, 0)


def test_it_holds_until_it_is_removed() -> None:
    device = PlayedDevice()
    with reading(device) as reader:
        assert reader.name == "played  [2J pad"
        wait_until(lambda: is_held(device, reader, HELD), "it holds")
        device.input = None
        wait_until(lambda: reader.steering() is None, "it is released")
        assert not reader.name
    assert device.closed_in not in {0, threading.get_ident()}, "SDL belongs to one thread"
    assert reader.steering() is None


def test_a_device_that_hangs_is_a_release() -> None:
    device = PlayedDevice()
    with reading(device) as reader:
        wait_until(lambda: is_held(device, reader, HELD), "it holds")
        device.works.clear()
        hung_s = time.monotonic()
        wait_until(lambda: reader.steering() is None, "it is released")
        assert time.monotonic() - hung_s < READING_COUNTS_S + 1.0
        device.works.set()
        device.seen()
        assert reader.steering() is None, "it is still held, and begins no motion"
        wait_until(lambda: is_held(device, reader, HELD), "it holds anew")


def test_what_is_forgotten_counts_again_after_it_was_up() -> None:
    device = PlayedDevice()
    with reading(device) as reader:
        wait_until(lambda: is_held(device, reader, HELD), "it holds")
        reader.forget()
        assert reader.steering() is None
        device.seen()
        assert reader.steering() is None
        device.input = PadInput(stop=True)
        wait_until(reader.take_stop, "STOP")


def test_one_without_a_cable_that_reports_nothing_new_is_released_until_it_was_up() -> None:
    device, up = PlayedDevice(), PadInput(wireless=True, values=(0,))
    held = replace(up, shoulder=True, values=(1,))
    device.input = up
    with reading(device) as reader:

        def is_released() -> bool:
            if not reader.problem():
                is_held(device, reader, held, up)
            return "2 s" in reader.problem()

        assert not is_released()
        wait_until(is_released, "it is released", 15 * HELD_FOR_S)
        assert reader.steering() is None
        device.input = replace(held, values=(2,))
        wait_until(lambda: not reader.problem(), "it reports again")
        assert reader.steering() is None
        wait_until(lambda: is_held(device, reader, held, up), "it holds anew")


def test_an_untouched_device_is_not_released_and_can_be_held() -> None:
    device, up = PlayedDevice(), PadInput(wireless=True, values=(0,))
    device.input = up
    with reading(device) as reader:
        time.sleep(HELD_FOR_S + 0.2)
        assert not reader.problem()
        held = replace(up, shoulder=True, values=(1,))
        wait_until(lambda: is_held(device, reader, held, up), "it holds")


def test_a_device_that_does_not_start_is_no_gamepad() -> None:
    def fail() -> PlayedDevice:
        raise UserError("no gamepads today")

    reader = GamepadReader(fail)
    reader.start()
    wait_until(lambda: reader.error, "why")
    assert reader.steering() is None
    reader.close()
