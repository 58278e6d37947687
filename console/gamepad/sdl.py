"""The only door to SDL 2 (https://wiki.libsdl.org/SDL2): the first gamepad that is plugged in.

SDL maps each model's buttons and sticks to those of one layout (its game controllers).
"""

from types import ModuleType
from typing import Any, Final

from common.errors import UserError
from console.gamepad.hands import PadInput

_FULL: Final = 32767
"""Largest value of an axis (SDL_GameControllerGetAxis)."""
_BUS_USB: Final = 0x03
"""First byte of a GUID of SDL's, from the kernel's input.h; the second is 0."""
_INSTALL: Final = (
    "Type: sudo apt install libsdl2-2.0-0, then, in a clone of the project: scripts/install-console"
)


def library() -> ModuleType:
    """Returns SDL's Python module.

    Raises:
        UserError: It is not installed, or SDL itself is not.
    """
    try:
        import sdl2  # noqa: PLC0415  # optional, and it loads the library
    except (ImportError, OSError) as error:
        raise UserError("a gamepad needs SDL 2 and PySDL2, which are not installed", _INSTALL) from error
    module: ModuleType = sdl2
    return module


class SdlPad:
    """The first gamepad. Belongs to the thread that makes it; to be closed there.

    Raises:
        UserError: SDL is not installed, or does not start.
    """

    def __init__(self) -> None:
        self._sdl: Any = library()
        sdl = self._sdl
        for hint, value in (
            # Ctrl-C is the program's own.
            (sdl.SDL_HINT_NO_SIGNAL_HANDLERS, b"1"),
            # There is no window of SDL's that could have the focus: what counts is the program's to decide.
            (sdl.SDL_HINT_JOYSTICK_ALLOW_BACKGROUND_EVENTS, b"1"),
        ):
            sdl.SDL_SetHint(hint, value)
        if sdl.SDL_InitSubSystem(sdl.SDL_INIT_GAMECONTROLLER):
            raise UserError(f"SDL can't read gamepads: {sdl.SDL_GetError().decode(errors='replace')}")
        # It is polled: events would fill a queue that no one reads.
        sdl.SDL_GameControllerEventState(sdl.SDL_IGNORE)
        sdl.SDL_JoystickEventState(sdl.SDL_IGNORE)
        self._pad: Any = None
        self.name = ""
        """As the gamepad names itself; empty without one."""

    def read(self) -> PadInput | None:
        """Returns the present input; None without a gamepad."""
        sdl = self._sdl
        sdl.SDL_GameControllerUpdate()
        sdl.SDL_FlushEvents(sdl.SDL_FIRSTEVENT, sdl.SDL_LASTEVENT)
        if self._pad and not sdl.SDL_GameControllerGetAttached(self._pad):
            self._put_away()
        if not self._pad:
            self._take_first()
        if not self._pad:
            return None
        return PadInput(
            left_x=self._axis(sdl.SDL_CONTROLLER_AXIS_LEFTX),
            left_y=self._axis(sdl.SDL_CONTROLLER_AXIS_LEFTY),
            right_x=self._axis(sdl.SDL_CONTROLLER_AXIS_RIGHTX),
            shoulder=self._is_down(sdl.SDL_CONTROLLER_BUTTON_LEFTSHOULDER)
            or self._is_down(sdl.SDL_CONTROLLER_BUTTON_RIGHTSHOULDER),
            stop=self._is_down(sdl.SDL_CONTROLLER_BUTTON_B),
            wireless=self._is_wireless(),
            values=self._values(),
        )

    def close(self) -> None:
        """Gives the gamepad and SDL back."""
        self._put_away()
        self._sdl.SDL_QuitSubSystem(self._sdl.SDL_INIT_GAMECONTROLLER)

    def _take_first(self) -> None:
        sdl = self._sdl
        for index in range(sdl.SDL_NumJoysticks()):
            if sdl.SDL_IsGameController(index):
                self._pad = sdl.SDL_GameControllerOpen(index)
                if self._pad:
                    self.name = (sdl.SDL_GameControllerName(self._pad) or b"").decode(errors="replace")
                    return

    def _put_away(self) -> None:
        if self._pad:
            self._sdl.SDL_GameControllerClose(self._pad)
        self._pad, self.name = None, ""

    def _axis(self, axis: int) -> float:
        return max(-1.0, float(self._sdl.SDL_GameControllerGetAxis(self._pad, axis)) / _FULL)

    def _is_down(self, button: int) -> bool:
        return bool(self._sdl.SDL_GameControllerGetButton(self._pad, button))

    def _is_wireless(self) -> bool:
        """Whether no cable is known of. A radio receiver on USB is one, unless it knows of a battery."""
        sdl, stick = self._sdl, self._stick()
        wired = (sdl.SDL_JOYSTICK_POWER_UNKNOWN, sdl.SDL_JOYSTICK_POWER_WIRED)
        bus = sdl.SDL_JoystickGetGUID(stick).data[0]
        return bus != _BUS_USB or sdl.SDL_JoystickCurrentPowerLevel(stick) not in wired

    def _values(self) -> tuple[int, ...]:
        """Returns all that the device reports, also what SDL's layout does not have."""
        sdl, stick = self._sdl, self._stick()
        kinds = (
            (sdl.SDL_JoystickNumAxes, sdl.SDL_JoystickGetAxis),
            (sdl.SDL_JoystickNumButtons, sdl.SDL_JoystickGetButton),
            (sdl.SDL_JoystickNumHats, sdl.SDL_JoystickGetHat),
        )
        return tuple(value(stick, number) for count, value in kinds for number in range(count(stick)))

    def _stick(self) -> Any:
        return self._sdl.SDL_GameControllerGetJoystick(self._pad)
