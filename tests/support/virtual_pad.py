"""A gamepad that SDL itself plays in this process, without any hardware."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

import sdl2

_FULL: Final = 32767
_AXES: Final = {"left_x": 0, "left_y": 1, "right_x": 2, "right_y": 3}
_AXIS_COUNT, _BUTTON_COUNT = 6, 15
"""Of SDL's own layout, in whose order a virtual one has its axes and buttons."""


class VirtualPad:
    """A gamepad that is plugged in."""

    def __init__(self) -> None:
        self._index = sdl2.SDL_JoystickAttachVirtual(
            sdl2.SDL_JOYSTICK_TYPE_GAMECONTROLLER, _AXIS_COUNT, _BUTTON_COUNT, 0
        )
        assert self._index >= 0, sdl2.SDL_GetError()
        self._stick: Any = sdl2.SDL_JoystickOpen(self._index)
        self._id = sdl2.SDL_JoystickInstanceID(self._stick)
        self.plugged_in = True

    def deflect(self, **sticks: float) -> None:
        """Moves sticks, each from -1 to 1."""
        for name, value in sticks.items():
            assert not sdl2.SDL_JoystickSetVirtualAxis(self._stick, _AXES[name], round(value * _FULL))

    def button(self, number: int, *, down: bool) -> None:
        """Presses or releases a button (SDL_CONTROLLER_BUTTON_...)."""
        assert not sdl2.SDL_JoystickSetVirtualButton(self._stick, number, down)

    def shoulder(self, *, down: bool) -> None:
        """Presses or releases hold-to-run."""
        self.button(sdl2.SDL_CONTROLLER_BUTTON_RIGHTSHOULDER, down=down)

    def unplug(self) -> None:
        """Takes it away, whatever is held."""
        if self.plugged_in:
            self.plugged_in = False
            present = range(sdl2.SDL_NumJoysticks())
            index = next(each for each in present if sdl2.SDL_JoystickGetDeviceInstanceID(each) == self._id)
            assert not sdl2.SDL_JoystickDetachVirtual(index), sdl2.SDL_GetError()
            sdl2.SDL_JoystickClose(self._stick)


@contextmanager
def virtual_pad() -> Iterator[VirtualPad]:
    """Plugged in when the block begins."""
    sdl2.SDL_SetHint(sdl2.SDL_HINT_NO_SIGNAL_HANDLERS, b"1")
    assert not sdl2.SDL_InitSubSystem(sdl2.SDL_INIT_GAMECONTROLLER), sdl2.SDL_GetError()
    pad = VirtualPad()
    try:
        yield pad
    finally:
        pad.unplug()
        sdl2.SDL_QuitSubSystem(sdl2.SDL_INIT_GAMECONTROLLER)
