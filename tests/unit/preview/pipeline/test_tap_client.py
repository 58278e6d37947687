"""The preview's end of the camera tap: frames, problems, and a tap that is broken or hostile."""

import fcntl
import os
import socket
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import pytest

from common.camera_tap import READY, Header, Kind, encode_examine, encode_text, encode_watch
from preview.pipeline.tap_client import TapClient, TapError, connection_problem, topic_problem

FRAME = Header(Kind.FRAME, 4, 2, 24, 123, "RGB")
PATIENCE_S = 5.0
ANSWER_S = 60.0
"""No thread of a test stands still for so long."""


@contextmanager
def listening(path: Path) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as listener:
        listener.bind(str(path))
        listener.listen()
        yield listener


@pytest.fixture
def ends(tmp_path: Path) -> Iterator[tuple[TapClient, socket.socket]]:
    """The client, and the tap's end of its connection."""
    with listening(tmp_path / "tap") as listener:
        client = TapClient(tmp_path / "tap", "/image")
        tap, _ = listener.accept()
        with tap:
            tap.settimeout(PATIENCE_S)
            assert tap.recv(1000) == encode_watch("/image")
            assert tap.recv(1000) == READY
            yield client, tap
        client.close()


SEALED = fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_WRITE


def memory(size: int = 24, seals: int = SEALED) -> int:
    descriptor = os.memfd_create("frame", os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING)
    os.write(descriptor, bytes(range(size)))
    fcntl.fcntl(descriptor, fcntl.F_ADD_SEALS, seals)
    return descriptor


def regular_file() -> int:
    return os.open(__file__, os.O_RDONLY)


def descriptors() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))


def send(tap: socket.socket, packet: bytes, *attached: int) -> None:
    socket.send_fds(tap, [packet], attached)
    for each in attached:
        os.close(each)


def test_a_frame_is_received_and_the_next_one_permitted(ends: tuple[TapClient, socket.socket]) -> None:
    client, tap = ends
    send(tap, FRAME.encode(), memory())
    frame = client.receive(PATIENCE_S)
    assert frame
    assert frame.header == FRAME
    assert os.pread(frame.memory, 24, 0) == bytes(range(24))
    assert not os.get_inheritable(frame.memory)
    os.close(frame.memory)
    assert tap.recv(100) == READY


def test_a_problem_is_kept_until_it_is_over(ends: tuple[TapClient, socket.socket]) -> None:
    client, tap = ends
    tap.send(encode_text(Kind.PROBLEM, "nothing publishes /image"))
    assert client.receive(PATIENCE_S) is None
    assert client.problem == "nothing publishes /image"
    tap.send(encode_text(Kind.PROBLEM, ""))
    assert client.receive(PATIENCE_S) is None
    assert client.problem == ""


def test_silence_is_no_error(ends: tuple[TapClient, socket.socket]) -> None:
    client, _ = ends
    assert client.receive(0.01) is None


def test_the_end_of_the_tap_is_one(ends: tuple[TapClient, socket.socket]) -> None:
    client, tap = ends
    tap.close()
    with pytest.raises(TapError, match="closed the connection"):
        client.receive(PATIENCE_S)


@pytest.mark.parametrize(
    ("packet", "attach", "words"),
    [
        (b"nonsense", None, "a packet of 8 bytes"),
        (b"nonsense", memory, "a packet of 8 bytes"),
        (FRAME.encode(), None, "0 descriptors"),
        (FRAME.encode(), regular_file, "not in a memfd"),
        (FRAME.encode(), lambda: memory(seals=0), "may shrink"),
        (FRAME.encode(), lambda: memory(seals=SEALED & ~fcntl.F_SEAL_SHRINK), "may shrink"),
        (FRAME.encode(), lambda: memory(seals=SEALED & ~fcntl.F_SEAL_WRITE), "or change"),
        (FRAME.encode(), lambda: memory(size=23), "24 bytes in memory of 23"),
        (encode_text(Kind.PROBLEM, "x"), memory, "descriptor without a frame"),
    ],
)
def test_a_hostile_tap_costs_its_connection_and_no_descriptor(
    ends: tuple[TapClient, socket.socket], packet: bytes, attach: Callable[[], int] | None, words: str
) -> None:
    client, tap = ends
    before = descriptors()
    send(tap, packet, *([attach()] if attach else []))
    with pytest.raises(TapError, match=words):
        client.receive(PATIENCE_S)
    assert descriptors() == before


def test_more_descriptors_than_one_are_not_kept(ends: tuple[TapClient, socket.socket]) -> None:
    client, tap = ends
    before = descriptors()
    send(tap, FRAME.encode(), memory(), memory(), memory())
    frame = client.receive(PATIENCE_S)
    assert frame
    os.close(frame.memory)
    assert descriptors() == before


def test_where_no_tap_serves_it_says_so(tmp_path: Path) -> None:
    path = tmp_path / "tap"
    assert connection_problem(path) == "it is not running"
    with listening(path):
        assert connection_problem(path) == ""
    assert connection_problem(path) == "it is not running", "a socket that was left behind"
    with pytest.raises(TapError, match="not running"):
        TapClient(path, "/image")


@pytest.mark.parametrize(
    ("answer", "says"),
    [
        (encode_text(Kind.PROBLEM, "nothing publishes /image"), "nothing publishes /image"),
        (encode_text(Kind.PROBLEM, ""), ""),
        (encode_text(Kind.STATUS, "{}" + " " * 20_000), ""),
        (b"", None),
        (b"nonsense", "the camera tap sent a packet of 8 bytes"),
    ],
    ids=["problem", "none", "older tap", "closed", "nonsense"],
)
def test_a_tap_is_asked_whether_a_topic_can_be_shown(tmp_path: Path, answer: bytes, says: str | None) -> None:
    path = tmp_path / "tap"
    with listening(path) as listener, ThreadPoolExecutor(1) as pool:
        listener.settimeout(ANSWER_S)
        asked = pool.submit(topic_problem, path, "/image", time.monotonic() + ANSWER_S)
        tap, _ = listener.accept()
        with tap:
            assert tap.recv(1000) == encode_examine("/image")
            if answer:
                tap.send(answer)
        assert asked.result(ANSWER_S) == says


@pytest.mark.parametrize("answer_s", [0.05, 0.0])
def test_one_that_does_not_answer_in_time_says_nothing(tmp_path: Path, answer_s: float) -> None:
    """Neither that the topic can be shown, nor that it can't."""
    path = tmp_path / "tap"
    with listening(path):
        assert topic_problem(path, "/image", time.monotonic() + answer_s) is None


def test_a_tap_that_is_gone_is_a_problem_of_its_topics(tmp_path: Path) -> None:
    says = topic_problem(tmp_path / "tap", "/image", time.monotonic() + ANSWER_S)
    assert says == "the camera tap can't be asked for /image: it is not running"
