"""Makes the clips of console/receiver/clips: `python -m tests.support.clips`."""

from pathlib import Path

from common.gst import Gst
from console.receiver import clips

FRAMES = 10
_ENCODERS = {
    "h264": "x264enc tune=zerolatency speed-preset=superfast bframes=0 bitrate=300 key-int-max=30"
    " ! video/x-h264,profile=main,stream-format=byte-stream,alignment=au",
    "h265": "x265enc tune=zerolatency speed-preset=superfast option-string=bframes=0:repeat-headers=1"
    " bitrate=300 key-int-max=30 ! video/x-h265,stream-format=byte-stream,alignment=au",
}


def main() -> None:
    """Writes both files."""
    for codec, encoder in _ENCODERS.items():
        content = b"".join(len(unit).to_bytes(clips.LENGTH_BYTES) + unit for unit in _encode(codec, encoder))
        file = Path(clips.__file__).with_name(f"{codec}.units")
        file.write_bytes(content)
        print(f"{file}: {len(content)} bytes")


def _encode(codec: str, encoder: str) -> list[bytes]:
    pipeline = Gst.parse_launch(
        f"videotestsrc pattern=smpte75 num-buffers={FRAMES}"
        f" ! video/x-raw,format=I420,width={clips.WIDTH_PX},height={clips.HEIGHT_PX},framerate=30/1"
        f" ! {encoder} ! {codec}parse config-interval=-1"
        f" ! video/x-{codec},stream-format=byte-stream,alignment=au ! appsink name=out sync=false"
    )
    pipeline.set_state(Gst.State.PLAYING)
    out, found = pipeline.get_by_name("out"), []
    while sample := out.emit("pull-sample"):
        buffer = sample.get_buffer()
        found.append(buffer.extract_dup(0, buffer.get_size()))
    pipeline.set_state(Gst.State.NULL)
    assert len(found) == FRAMES
    return found


if __name__ == "__main__":
    main()
