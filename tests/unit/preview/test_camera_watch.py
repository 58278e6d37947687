"""Looking which cameras are there goes on, whatever a look ends with."""

import asyncio
import socket
import threading
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from preview import camera_watch
from preview.camera_watch import LOOK_EVERY_S, PAUSE_AFTER_HANG_S, problems, watch_cameras
from preview.config import CameraTapSettings, PreviewSettings, RosSource, TestSource
from preview.pipeline import sources
from preview.pipeline.threads import SharedCall
from tests.support.virtual_time import in_virtual_time


@in_virtual_time
async def test_a_look_that_fails_is_repeated(monkeypatch: pytest.MonkeyPatch) -> None:
    """The defect: the first error was the last look, and no line of the log said so."""
    looks, found_s = [ValueError("embedded null byte"), TimeoutError(), None], list[float]()
    loop = asyncio.get_running_loop()

    async def look(*_: object) -> dict[str, str]:
        if error := looks.pop(0) if looks else None:
            raise error
        return {}

    monkeypatch.setattr(SharedCall, "result", look)
    supervisor: Any = SimpleNamespace(
        is_watched=True, unused_cameras=(), cameras_found=lambda _: found_s.append(loop.time())
    )
    began_s = loop.time()
    watching = asyncio.create_task(watch_cameras(supervisor, PreviewSettings()))
    while len(found_s) < 2:
        await asyncio.sleep(1)
        assert not watching.done()
    watching.cancel()
    first_s = found_s[0] - began_s
    assert first_s == pytest.approx(2 * PAUSE_AFTER_HANG_S, abs=1)
    assert found_s[1] - found_s[0] == pytest.approx(LOOK_EVERY_S, abs=0.1)


@in_virtual_time
async def test_a_camera_that_came_into_use_during_a_look_is_not_reported(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The defect: a look that had hung for minutes marked a camera as missing that was live by then."""
    reported = list[dict[str, str]]()
    supervisor: Any = SimpleNamespace(
        is_watched=True, unused_cameras=("front", "rear", "arm"), cameras_found=reported.append
    )

    async def look(*_: object) -> dict[str, str]:
        supervisor.unused_cameras = ("rear", "arm")
        return {"front": "no such device", "rear": "no such device", "arm": ""}

    monkeypatch.setattr(SharedCall, "result", look)
    watching = asyncio.create_task(watch_cameras(supervisor, PreviewSettings()))
    await asyncio.sleep(LOOK_EVERY_S / 2)
    watching.cancel()
    assert reported == [{"rear": "no such device", "arm": ""}]


@in_virtual_time
async def test_a_look_that_hangs_is_the_only_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """The defect: each attempt left one more thread behind, a minute after the last."""
    answers, found = threading.Event(), list[object]()

    def look(*_: object) -> dict[str, str]:
        answers.wait(30)
        return {}

    def threads() -> int:
        return sum(thread.name == "blocking-call" for thread in threading.enumerate())

    monkeypatch.setattr(camera_watch, "problems", look)
    supervisor: Any = SimpleNamespace(is_watched=True, unused_cameras=(), cameras_found=found.append)
    before = threads()
    watching = asyncio.create_task(watch_cameras(supervisor, PreviewSettings()))
    try:
        await asyncio.sleep(10 * PAUSE_AFTER_HANG_S)
        assert threads() == before + 1
        assert not found
    finally:
        answers.set()
        watching.cancel()


def test_a_tap_that_hangs_is_waited_for_once_and_says_nothing_of_its_topics(tmp_path: Path) -> None:
    """Other cameras are looked at all the same; these stay as they are."""
    path, requests = tmp_path / "tap", list[bytes]()
    settings = PreviewSettings(
        cameras={
            "arm": RosSource(topic="/arm/image_raw"),
            "rear": RosSource(topic="/rear/image_raw"),
            "front": TestSource(),
        },
        camera_tap=CameraTapSettings(socket=path),
    )
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as tap:
        tap.bind(str(path))
        tap.listen()
        found = problems(settings, settings.named_sources)
        tap.settimeout(0)
        for _ in range(2 * len(settings.cameras)):
            try:
                connection, _ = tap.accept()
            except BlockingIOError:
                break
            with connection:
                requests.append(connection.recv(1000))
    assert found == {"front": ""}
    assert sum(map(bool, requests)) <= 1, "topics share the time for answers"
    assert camera_watch.TAP_ANSWERS_S <= camera_watch.LOOK_DEADLINE_S / 2, "the rest is for the others"


def test_that_time_does_not_go_by_at_a_slow_file(monkeypatch: pytest.MonkeyPatch) -> None:
    looked_at = list[str]()

    def look(_settings: PreviewSettings, camera: str, _until_s: float) -> str:
        looked_at.append(camera)
        return ""

    monkeypatch.setattr(sources, "camera_problem", look)
    settings = PreviewSettings(
        cameras={"film": TestSource(), "arm": RosSource(topic="/arm"), "rear": RosSource(topic="/rear")}
    )
    problems(settings, settings.named_sources)
    assert looked_at == ["arm", "rear", "film"]
