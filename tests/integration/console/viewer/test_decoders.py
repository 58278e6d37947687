"""Hardware decoders: only those that prove themselves are used, and one that fails later is replaced."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import psutil
import pytest

from console.receiver import clips
from console.receiver.decoder_probe import objection
from tests.support.clips import FRAMES
from tests.support.processes import has_ended
from tests.support.promise import MS, keeps
from tests.support.robotctl import viewed
from tests.support.video_ground import VideoGround, video_ground
from tests.support.waiting import wait_until

pytestmark = pytest.mark.gst

ROOT = Path(__file__).parents[4]
DOUBLES = ROOT / "tests/support/decoder_doubles"


def with_doubles(**faults: str) -> dict[str, str]:
    """Environment of a computer with these decoders."""
    path = os.pathsep.join([str(DOUBLES), str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
    return {"PYTHONPATH": path, "DECODER_DOUBLES": json.dumps(faults)}


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[VideoGround]:
    """The preview is on."""
    with video_ground(tmp_path_factory.mktemp("ground")) as ground:
        ground.switch_on()
        yield ground


def seen(ground: VideoGround, **faults: str) -> dict[str, Any]:
    """What a viewer with these decoders saw."""
    done = viewed(
        *("--target", ground.target, "--json", "view", "--headless", "--frames", "10"),
        **with_doubles(**faults),
    )
    assert done.returncode == 0, done.stderr
    assert "GStreamer-CRITICAL" not in done.stderr
    document: dict[str, Any] = json.loads(done.stdout)
    return document


@pytest.mark.parametrize("codec", ["h264", "h265"])
def test_software_decodes_the_clips_rightly(codec: str) -> None:
    assert len(clips.units(codec)) == FRAMES
    assert objection(f"avdec_{codec}", codec) == ""


@pytest.mark.parametrize(
    ("fault", "why"),
    [
        ("ok", ""),
        ("refuse", "the device can't be opened"),
        ("silent", "it decodes no frame"),
        ("late", "frames back"),
        ("wrong", "its frames are wrong"),
        ("crash", "it crashed when tried (SIGSEGV)"),
        ("error", "the driver reports a hardware fault"),
        ("hang", "it decodes no frame"),
        ("stuck", "it hung: no result within 3 s"),
    ],
)
def test_a_trial_finds_what_is_wrong(fault: str, why: str) -> None:
    # Time enough for a busy machine, except for what only its end shows.
    within_s = 3 if fault == "stuck" else 20
    attempt = f"print(objection('vah264dec', 'h264', {within_s}))"
    code = f"from console.receiver.decoder_probe import objection; {attempt}"
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | with_doubles(vah264dec=fault),
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    said = done.stdout.strip()
    assert said == why or (why and why in said), done


TRIAL = "console.receiver.decoder_trial"
TRIED_WITHIN_S = 60.0
FIRST_PICTURE_MS = 6000


@contextmanager
def trial_in_progress(**environment: str) -> Iterator[tuple["subprocess.Popen[bytes]", psutil.Process]]:
    """A program that tries a decoder, and its trial."""
    code = "from console.receiver.decoder_probe import objection; objection('vah264dec', 'h264', 60)"
    with subprocess.Popen([sys.executable, "-c", code], cwd=ROOT, env=os.environ | environment) as parent:
        try:
            found = wait_until(lambda: psutil.Process(parent.pid).children(), "its trial has begun")
            yield parent, found[0]
        finally:
            parent.kill()


def test_a_trial_that_hangs_in_its_driver_ends_with_its_parent() -> None:
    with trial_in_progress(**with_doubles(vah264dec="stuck")) as (parent, trial):
        wait_until(
            lambda: any("libgstreamer" in each.path for each in trial.memory_maps()), "GStreamer is loaded"
        )
        parent.kill()
        wait_until(lambda: has_ended(trial.pid), "it ends")


def test_a_trial_that_hangs_before_it_has_loaded_gstreamer_ends_with_its_parent(tmp_path: Path) -> None:
    begun = tmp_path / "begun"
    (tmp_path / "gi").mkdir()
    (tmp_path / "gi/__init__.py").write_text(
        f"import pathlib, sys, time\n"
        f"if {TRIAL!r} in sys.orig_argv:\n"
        f"    pathlib.Path({str(begun)!r}).touch()\n"
        f"    time.sleep(60)\n"
    )
    with trial_in_progress(PYTHONPATH=str(tmp_path)) as (parent, trial):
        wait_until(begun.exists, "it loads GStreamer")
        parent.kill()
        wait_until(lambda: has_ended(trial.pid), "it ends")


def test_a_trial_whose_parent_is_gone_already_does_not_begin() -> None:
    someone_else = str(os.getppid())
    done = subprocess.run(
        [sys.executable, "-m", "common.trial_child", someone_else, TRIAL, "avdec_h264", "h264"],
        cwd=ROOT,
        capture_output=True,
        timeout=60,
        check=False,
    )
    assert (done.returncode, done.stdout) == (os.EX_UNAVAILABLE, b"")


def test_a_proven_decoder_is_used(running: VideoGround) -> None:
    # A viewer whose trials take longer than 3 s, as on a machine that stands still, begins in software.
    wait_until(lambda: seen(running, vah264dec="ok")["decoder"] == "vah264dec", "it is used", TRIED_WITHIN_S)


def test_the_first_that_proves_itself_is_used(running: VideoGround) -> None:
    faults = {"vah264dec": "wrong", "nvh264dec": "ok"}
    wait_until(lambda: seen(running, **faults)["decoder"] == "nvh264dec", "it is used", TRIED_WITHIN_S)


def test_where_none_proves_itself_software_decodes(running: VideoGround) -> None:
    assert seen(running, vah264dec="refuse", nvh264dec="late")["decoder"] == "avdec_h264"


@pytest.mark.parametrize("fault", ["later error", "later silent", "later refuse"])
def test_one_that_fails_with_the_real_stream_is_replaced_by_software(
    running: VideoGround, fault: str
) -> None:
    document = seen(running, vah264dec=fault)
    assert document["decoder"] == "avdec_h264"
    assert document["redials"] >= 1


@pytest.mark.timed
def test_a_decoder_that_hangs_in_its_trial_does_not_delay_the_video(running: VideoGround) -> None:
    def first_picture_ms() -> float:
        document = seen(running, vah264dec="stuck")
        assert document["decoder"] == "avdec_h264"
        return float(document["first_picture_ms"])

    keeps(FIRST_PICTURE_MS, "ms until the first picture", first_picture_ms, per_stalled_s=MS)
