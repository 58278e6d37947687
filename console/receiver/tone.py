"""A short alarm tone, played with GStreamer: the project's only use of a sound device."""

from typing import Final

from common.errors import UserError

_HZ: Final = 880
_BUFFERS: Final = 12
_SAMPLES: Final = 1024
"""Of each buffer, at 44.1 kHz: 0.28 s in all."""
_ENDS_WITHIN_S: Final = 3


def play_tone(sink: str = "autoaudiosink") -> None:
    """Plays the tone, and returns at its end.

    Args:
        sink: GStreamer's element that plays it.

    Raises:
        UserError: there is no GStreamer, or no sound device, or it does not play.
    """
    # Imported here so that a window opens without GStreamer.
    from common.gst import GLib, Gst, stop  # noqa: PLC0415

    description = (
        f"audiotestsrc num-buffers={_BUFFERS} samplesperbuffer={_SAMPLES} freq={_HZ} volume=0.4"
        f" ! audioconvert ! audioresample ! {sink}"
    )
    try:
        pipeline = Gst.parse_launch(description)
    except GLib.Error as error:
        raise UserError(f"no alarm can be heard: {error}", "Install gstreamer1.0-plugins-good") from error
    try:
        pipeline.set_state(Gst.State.PLAYING)
        ends = Gst.MessageType.EOS | Gst.MessageType.ERROR
        message = pipeline.get_bus().timed_pop_filtered(_ENDS_WITHIN_S * Gst.SECOND, ends)
        if message is None or message.type == Gst.MessageType.ERROR:
            reason = message.parse_error()[0].message if message else "the sound device does not answer"
            raise UserError(f"no alarm can be heard: {reason}", "Check this computer's sound device")
    finally:
        stop(pipeline)
