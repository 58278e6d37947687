"""The program itself: what it says when it can't start, and how it ends."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from tempfile import mkdtemp

import psutil
import pytest

from common.guard import EXIT_SILENT
from tests.support.processes import has_ended
from tests.support.promise import keeps
from tests.support.running_preview import ROOT, RunningPreview
from tests.support.waiting import wait_until

pytestmark = pytest.mark.gst


def run(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "preview.cli", *arguments],
        cwd=ROOT,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


def one_line(result: subprocess.CompletedProcess[str], code: int, *words: str) -> None:
    assert result.returncode == code
    lines = [line for line in result.stderr.splitlines() if " INFO " not in line]
    assert len(lines) == 1, result.stderr
    for word in words:
        assert word in lines[0]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("srt: {prot: 7100}", ("unknown key 'srt.prot'",)),
        ("srt: {port: 99999}", ("srt.port", "99999", "65535")),
        ("encoders: {order: [quicksync]}", ("encoders.order", "quicksync", "mpp-h265")),
        ("encoders: {order: [x264], codec: h265}", ("no encoder in the order makes h265",)),
        ("source: {kind: v4l2}", ("name either the device", "or the card")),
        ("source: {kind: telescope}", ("source", "telescope", "v4l2")),
        ("profiles: {balanced: {floor_kbps: 9000}}", ("floor_kbps must not be above bitrate_kbps",)),
        (f"socket: /{'x' * 107}", ("line 1: key 'socket' is", "a path of at most 107 bytes")),
        ("- a list", ("list",)),
    ],
)
def test_a_wrong_configuration_is_one_line(tmp_path: Path, text: str, words: tuple[str, ...]) -> None:
    config = tmp_path / "preview.yaml"
    config.write_text(text, encoding="utf-8")
    for command in ("serve", "check", "encoders"):
        one_line(run(command, "--config", str(config)), 2, str(config), *words)


def test_a_variable_that_is_wrong_is_one_line() -> None:
    one_line(run("check", PREVIEW__SRT__PORT="many"), 2, "srt.port", "many", "PREVIEW__")


def test_a_socket_that_can_not_be_made_is_one_line(tmp_path: Path) -> None:
    one_line(run("serve", PREVIEW__SOCKET="/proc/preview.sock"), 1, "/proc/preview.sock")
    with socket.socket(socket.AF_UNIX) as other:
        path = tmp_path / "taken.sock"
        other.bind(str(path))
        other.listen()
        one_line(run("serve", PREVIEW__SOCKET=str(path)), 1, str(path), "served by another program")


def test_without_gstreamer_it_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "gi.py").write_text("raise ImportError('no gi here')\n", encoding="utf-8")
    result = run("serve", PYTHONPATH=str(tmp_path), PREVIEW__SOCKET=str(tmp_path / "preview.sock"))
    one_line(result, 1, "GStreamer can't be used from Python", "scripts/setup")


def test_without_plugins_the_preview_says_what_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("GST_PLUGIN_SYSTEM_PATH_1_0", str(tmp_path / "empty"))
    monkeypatch.setenv("GST_REGISTRY", str(tmp_path / "registry.bin"))
    with RunningPreview(tmp_path) as preview:
        preview.enable()
        state = preview.faulted()
        assert "none of their GStreamer elements is installed" in state.last_error


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_it_with_everything_tidy(preview: RunningPreview, number: signal.Signals) -> None:
    preview.enable()
    preview.running()
    preview.process.send_signal(number)
    assert preview.process.wait(20) == 0
    assert not preview.socket.exists()
    assert "Traceback" not in preview.log.read_text(encoding="utf-8")


@pytest.mark.timed
@pytest.mark.timeout(240)
def test_frozen_it_is_killed_by_its_guard(tmp_path: Path) -> None:
    """Documented: within 11 s; what runs in the container."""
    keeps(11, "s from the freeze to the guard's end", lambda: killed_after_s(Path(mkdtemp(dir=tmp_path))))


def killed_after_s(directory: Path) -> float:
    path = directory / "preview.sock"
    with subprocess.Popen(
        [sys.executable, "-m", "common.guard", sys.executable, "-m", "preview.cli", "serve"],
        cwd=ROOT,
        env={**os.environ, "PREVIEW__SOCKET": str(path), "PREVIEW__SOURCE__KIND": "test"},
        stderr=subprocess.PIPE,
        text=True,
    ) as guard:
        try:
            wait_until(path.exists, "the service is up", 30)
            (service,) = psutil.Process(guard.pid).children()
            service.suspend()
            frozen_s = time.monotonic()
            assert guard.wait(30) == EXIT_SILENT
            took_s = time.monotonic() - frozen_s
            assert has_ended(service.pid)
        finally:
            guard.terminate()
        return took_s


def test_encoders_are_listed_for_people_and_programs() -> None:
    table = run("encoders", PREVIEW__SOURCE__KIND="test")
    assert table.returncode == 0, table.stderr
    row = next(line for line in table.stdout.splitlines() if " x264enc " in line)
    assert row.split()[:6] == ["x264", "x264", "x264enc", "h264", "yes", "yes"]
    rows = json.loads(run("encoders", "--json", PREVIEW__ENCODERS__PROBE_TIMEOUT_S="40").stdout)
    by_name = {one["name"]: one for one in rows}
    assert by_name["x264"]["proven"] is True
    assert by_name["x264"]["first_byte_ms"] > 0
    assert by_name["mpp-h265"]["present"] is False
    assert rows[0]["name"] == "mpp-h265"
