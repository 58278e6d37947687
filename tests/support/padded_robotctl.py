"""robotctl with a virtual gamepad: `python -m tests.support.padded_robotctl WORD...`.

SIGUSR1 moves its left stick forward and holds, again and again if it comes again: then a stick that steers
nothing moves with it. SIGUSR2 unplugs it, whatever is held.
"""

import signal
import sys
from types import FrameType

from console.cli import main
from tests.support.virtual_pad import VirtualPad, virtual_pad


def act_on_signals(pad: VirtualPad) -> None:
    """Has the signals play the gamepad."""
    held = 0

    def hold(_number: int, _frame: FrameType | None) -> None:
        nonlocal held
        held += 1
        pad.deflect(left_y=-1.0, right_y=held % 2 / 2)
        pad.shoulder(down=True)

    def unplug(_number: int, _frame: FrameType | None) -> None:
        pad.unplug()

    signal.signal(signal.SIGUSR1, hold)
    signal.signal(signal.SIGUSR2, unplug)


if __name__ == "__main__":
    sys.argv[0] = "robotctl"
    with virtual_pad() as plugged_in:
        act_on_signals(plugged_in)
        main()
