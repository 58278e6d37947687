"""The double of twist_mux: it forwards on receipt, and says nothing by itself."""

from simrobot.mux import Mux, MuxInput


def test_the_highest_priority_is_forwarded_until_its_timeout() -> None:
    mux = Mux()
    assert mux.forwards(MuxInput.AUTONOMY, 0.0)
    assert mux.forwards(MuxInput.KEYBOARD, 0.1)
    assert not mux.forwards(MuxInput.AUTONOMY, 0.2)
    assert mux.forwards(MuxInput.JOYSTICK, 0.3)
    assert not mux.forwards(MuxInput.KEYBOARD, 0.4)
    assert not mux.forwards(MuxInput.AUTONOMY, 0.9), "the keyboard's timeout counts from its last message"
    assert mux.forwards(MuxInput.AUTONOMY, 0.91)


def test_the_lock_masks_every_input_also_zeros() -> None:
    mux = Mux()
    mux.locked = True
    assert not any(mux.forwards(source, 0.0) for source in MuxInput)
    mux.locked = False
    assert mux.forwards(MuxInput.JOYSTICK, 0.1)
