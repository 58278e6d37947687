"""The settings, and the catalogue they name."""

import tempfile
from pathlib import Path

import pytest

from common.config import as_yaml, load
from common.errors import UserError
from preview.config import PreviewSettings, RosSource, TestSource, V4l2Source
from preview.encoders.catalogue import CATALOGUE, DEFAULT_ORDER
from preview.state.values import Codec, Profile


def from_text(tmp_path: Path, text: str) -> PreviewSettings:
    path = tmp_path / "preview.yaml"
    path.write_text(text, encoding="utf-8")
    return load(PreviewSettings, path)


def test_the_defaults_suit_the_first_robot() -> None:
    settings = load(PreviewSettings, None)
    assert settings.source == V4l2Source(card="rkisp_mainpath")
    targets = settings.profiles.targets
    assert {p: (t.width_px, t.height_px, t.fps, t.bitrate_kbps) for p, t in targets.items()} == {
        Profile.LOW_BW: (1280, 720, 15, 1000),
        Profile.BALANCED: (1280, 720, 30, 2500),
        Profile.HIGH_QUALITY: (1280, 720, 60, 4500),
    }
    assert (settings.srt.port, settings.srt.latency_ms) == (7100, 125)
    assert settings.encoders.allowed[0].name == "mpp-h265"
    assert settings.encoders.allowed[-1].name == "x264"
    assert settings.adaptive.enabled


def test_a_source_replaces_the_default_whole(tmp_path: Path) -> None:
    assert from_text(tmp_path, "source: {kind: v4l2, device: /dev/video3}").source.device == "/dev/video3"  # type: ignore[union-attr]


def test_one_figure_of_a_profile_may_be_changed(tmp_path: Path) -> None:
    low = from_text(tmp_path, "profiles: {low_bw: {bitrate_kbps: 700}}").profiles.low_bw
    assert (low.bitrate_kbps, low.fps, low.floor_kbps) == (700, 15, 300)


def test_a_computer_without_a_hardware_encoder_wants_the_one_in_software(tmp_path: Path) -> None:
    """As the gateway proposes (preview.fallback) and the documents do."""
    settings = from_text(tmp_path, "encoders: {order: [x264]}")
    assert [encoder.name for encoder in settings.encoders.allowed] == ["x264"]


def test_two_previews_of_one_machine_have_a_directory_each(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each finds its own crash marker there, wherever the port comes from; one that is configured stays."""
    for run in (None, tmp_path / "run"):
        monkeypatch.delenv("XDG_RUNTIME_DIR", raising=False)
        if run:
            monkeypatch.setenv("XDG_RUNTIME_DIR", str(run))
        monkeypatch.delenv("PREVIEW__SRT__PORT", raising=False)
        first, second = (from_text(tmp_path, f"srt: {{port: {port}}}").runtime_dir for port in (7100, 7200))
        assert first != second
        assert first.parent == second.parent == (run or Path(tempfile.gettempdir()))
        assert from_text(tmp_path, "{}").runtime_dir == first, "7100 is the default"
        monkeypatch.setenv("PREVIEW__SRT__PORT", "7200")
        assert from_text(tmp_path, "srt: {port: 7100}").runtime_dir == second
        assert from_text(tmp_path, "runtime_dir: /run/mine").runtime_dir == Path("/run/mine")


def test_a_codec_restricts_the_order() -> None:
    settings = PreviewSettings(encoders={"codec": "h264"})  # type: ignore[arg-type]
    assert all(encoder.codec is Codec.H264 for encoder in settings.encoders.allowed)
    assert settings.encoders.allowed[-1].name == "x264"


@pytest.mark.parametrize(
    "text", ["encoders: {order: []}", "encoders: {order: [x264, x264]}", "srt: {key_length_bytes: 8}"]
)
def test_nonsense_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(UserError):
        from_text(tmp_path, text)


def test_hardware_h265_comes_before_hardware_h264_before_software() -> None:
    entries = [CATALOGUE[name] for name in DEFAULT_ORDER]
    ranks = [(not e.hardware, e.codec is Codec.H264) for e in entries]
    assert ranks == sorted(ranks)
    assert {e.family for e in CATALOGUE.values()} == {
        *("mpp", "v4l2", "va", "nv", "nvv4l2", "qsv", "msdk", "x264", "x265"),
    }
    for family in ("mpp", "v4l2", "va", "nv", "nvv4l2", "qsv", "msdk"):
        assert {e.codec for e in entries if e.family == family} == set(Codec)


def test_every_encoder_has_a_bit_rate_and_a_gop_length() -> None:
    for encoder in CATALOGUE.values():
        properties = encoder.properties
        controlled = set(properties.controls.values())
        assert properties.bitrate or "bitrate" in controlled, encoder.name
        assert properties.gop or "gop" in controlled, encoder.name


def test_profiles_are_spelled_as_everywhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With a hyphen; the underscore of environment variables and of earlier files means the same."""
    monkeypatch.setenv("PREVIEW__PROFILES__LOW_BW__FPS", "12")
    for name in ("low-bw", "low_bw"):
        settings = from_text(tmp_path, f"profiles: {{{name}: {{fps: 10, width_px: 640}}}}")
        low = settings.profiles.low_bw
        assert (low.fps, low.width_px, low.bitrate_kbps) == (12, 640, 1000)
        assert "low-bw:" in as_yaml(settings)
        assert "low_bw" not in as_yaml(settings)
    monkeypatch.delenv("PREVIEW__PROFILES__LOW_BW__FPS")
    with pytest.raises(UserError, match=r"line 2: key 'profiles.low-bw.fps' is 0"):
        from_text(tmp_path, "profiles:\n low_bw: {fps: 0, width_px: 640}")


FRONT_AND_REAR = """
cameras:
  front: {kind: v4l2, card: rkisp_mainpath, fallback: rear}
  rear: {kind: v4l2, device: /dev/video2}
"""


def test_a_single_source_is_the_only_camera(tmp_path: Path) -> None:
    settings = from_text(tmp_path, "source: {kind: test}")
    assert settings.named_sources == {"camera": TestSource()}
    assert "cameras: {}" in as_yaml(settings)


def test_cameras_have_names_and_an_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    settings = from_text(tmp_path, FRONT_AND_REAR)
    assert list(settings.named_sources) == ["front", "rear"]
    assert settings.named_sources["front"].fallback == "rear"
    assert from_text(tmp_path, as_yaml(settings)).named_sources == settings.named_sources
    # As an overlay of a robot with one camera sets it.
    monkeypatch.setenv("PREVIEW__SOURCE__KIND", "test")
    assert list(from_text(tmp_path, FRONT_AND_REAR).named_sources) == ["front", "rear"]
    monkeypatch.setenv("PREVIEW__CAMERAS__REAR__DEVICE", "/dev/video5")
    rear = from_text(tmp_path, FRONT_AND_REAR).named_sources["rear"]
    assert rear == V4l2Source(device="/dev/video5")


def test_two_cameras_may_have_cards_or_devices_of_their_own(tmp_path: Path) -> None:
    text = """
cameras:
  front: {kind: v4l2, device: "/dev/v4l/by-path/pci-0000:00:14.0-usb-0:1:1.0-video-index0"}
  rear: {kind: v4l2, device: "/dev/v4l/by-path/pci-0000:00:14.0-usb-0:2:1.0-video-index0", format: jpeg}
  arm: {kind: v4l2, card: "USB Camera"}
  mast: {kind: v4l2, card: rkisp_mainpath}
"""
    assert list(from_text(tmp_path, text).named_sources) == ["front", "rear", "arm", "mast"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("source: {kind: test, fallback: rear}", "a single source has no other to fall back on"),
        ("cameras: {front: {kind: test, fallback: back}, rear: {kind: test}}", r"\(there are: rear\)"),
        ("cameras: {front: {kind: test, fallback: front}}", r"\(there are: none\), not 'front'"),
        ("cameras: {Front door: {kind: test}}", "Front door"),
        ("cameras: {front: {kind: v4l2, device: a, card: b}}", "name either the device"),
        (
            "cameras: {front: {kind: v4l2, card: USB}, rear: {kind: v4l2, card: USB}}",
            "front and rear name the same card USB, which is one device; .* /dev/v4l/by-path",
        ),
        (
            "cameras: {front: {kind: v4l2, device: /dev/video0}, rear: {kind: v4l2, device: /dev/video0}}",
            "front and rear name the same device /dev/video0",
        ),
        ("source: {kind: v4l2, device: a, format: mjpg}", "one of auto, raw, jpeg"),
        (f"cameras: {{{', '.join(f'c{i}: {{kind: test}}' for i in range(17))}}}", "16"),
    ],
)
def test_cameras_that_contradict_themselves_are_refused(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(UserError, match=words):
        from_text(tmp_path, text)


def test_one_device_under_two_names_is_one_device(tmp_path: Path) -> None:
    node, link = tmp_path / "video11", tmp_path / "usb-video-index0"
    node.touch()
    link.symlink_to(node.name)
    text = f"cameras: {{front: {{kind: v4l2, device: {node}}}, rear: {{kind: v4l2, device: {link}}}}}"
    with pytest.raises(UserError, match=f"front and rear name the same device {node}, which is one device"):
        from_text(tmp_path, text)


def test_a_topic_is_a_source_by_its_full_name(tmp_path: Path) -> None:
    settings = from_text(tmp_path, "cameras: {arm: {kind: ros, topic: /arm/image_raw}}")
    assert settings.cameras["arm"] == RosSource(topic="/arm/image_raw")
    for wrong in ("image_raw", "/", "/arm/", "/arm image", "~/image"):
        with pytest.raises(UserError, match="no full name of a topic"):
            from_text(tmp_path, f"source: {{kind: ros, topic: '{wrong}'}}")
