"""What a gamepad holds: a shoulder button is hold-to-run, the sticks steer. Pure."""

from dataclasses import dataclass, field

from console.gamepad.shaping import is_neutral, shaped
from console.steering import Steering


@dataclass(frozen=True, slots=True)
class PadInput:
    """A gamepad at one moment. Sticks are from -1 to 1, right and down are positive, as SDL has it.

    Args:
        left_x: left stick, sideways.
        left_y: left stick, up and down.
        right_x: right stick, sideways.
        shoulder: whether a shoulder button is down.
        stop: whether the button for STOP is down.
        wireless: whether it may be out of range without being unplugged.
        values: all that it reports, whatever it stands for.
    """

    left_x: float = 0.0
    left_y: float = 0.0
    right_x: float = 0.0
    shoulder: bool = False
    stop: bool = False
    wireless: bool = field(default=False, compare=False)
    values: tuple[int, ...] = field(default=(), compare=False)

    @property
    def sticks(self) -> tuple[float, float, float]:
        """Deflections that steer: forward, left, turn."""
        return -self.left_y, -self.left_x, -self.right_x


class PadHands:
    """Follows a gamepad.

    The shoulder button counts after it was seen up, each stick after it was seen neutral: a gamepad that is
    plugged in, or returned to, while something lies on it drives nothing.
    """

    def __init__(self) -> None:
        self._seen_up = False
        self._seen_neutral = [False, False, False]
        self._stop_was_down = True
        self._stops = 0
        self.steering: Steering | None = None
        """How it steers; None while it does not hold."""

    def take(self, pad: PadInput | None) -> None:
        """Takes the present input; None without a gamepad, which is a release."""
        if pad is None:
            self.forget()
            self._stop_was_down = True
            return
        self._stops += pad.stop and not self._stop_was_down
        self._stop_was_down = pad.stop
        self._seen_up = self._seen_up or not pad.shoulder
        for axis, deflection in enumerate(pad.sticks):
            self._seen_neutral[axis] = self._seen_neutral[axis] or is_neutral(deflection)
        if not (pad.shoulder and self._seen_up):
            self.steering = None
            return
        counted = zip(pad.sticks, self._seen_neutral, strict=True)
        self.steering = Steering(*(shaped(deflection) if seen else 0.0 for deflection, seen in counted))

    def take_stop(self) -> bool:
        """Returns whether STOP was pressed since the last call."""
        pressed, self._stops = self._stops > 0, 0
        return pressed

    def forget(self) -> None:
        """Releases; the shoulder has to be seen up, and the sticks neutral, anew. STOP goes on to count."""
        self.steering = None
        self._seen_up = False
        self._seen_neutral = [False, False, False]
