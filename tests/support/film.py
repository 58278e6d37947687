"""Short films for the file source."""

from pathlib import Path

from common.gst import Gst


def clip(seconds: float, path: Path, container: str = "matroskamux") -> Path:
    """A short film of a moving ball, compressed."""
    pipeline = Gst.parse_launch(
        f"videotestsrc num-buffers={round(seconds * 25)} pattern=ball"
        " ! video/x-raw,format=I420,width=320,height=240,framerate=25/1"
        f" ! x264enc speed-preset=ultrafast key-int-max=25 ! h264parse ! {container} ! filesink name=out"
    )
    pipeline.get_by_name("out").set_property("location", str(path))
    pipeline.set_state(Gst.State.PLAYING)
    message = pipeline.get_bus().timed_pop_filtered(
        20 * Gst.SECOND, Gst.MessageType.EOS | Gst.MessageType.ERROR
    )
    pipeline.set_state(Gst.State.NULL)
    assert message.type == Gst.MessageType.EOS
    return path
