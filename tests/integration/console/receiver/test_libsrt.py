"""Which libsrt is taken, and what is said of one that can't be."""

import atexit
import ctypes
import errno
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from console.receiver import libsrt
from console.receiver.libsrt import LibsrtMissingError, LocalSocketError

pytestmark = pytest.mark.gst

ROOT = Path(__file__).parents[4]
GOOD = 0x010501
MAPPED = re.compile(r"\S*/libsrt[-.]\S*")
BOTH_LOADED = """
import sys
from common.gst import Gst
from console.receiver import libsrt
libsrt._NAMES = (sys.argv[1],)
libsrt.load()
assert Gst.ElementFactory.make("srtsrc"), "GStreamer's SRT plugin is not installed"
print(open("/proc/self/maps", encoding="utf-8").read())
"""


class Library:
    """A libsrt of this version, without these functions."""

    def __init__(self, version: int = GOOD, *, lacks: str = "", starts: int = 0) -> None:
        self.starts = 0
        answers = {"srt_getversion": version, "srt_startup": starts}
        for name in (*libsrt._SIGNATURES, "srt_getversion"):
            if name != lacks:
                setattr(self, name, self._function(answers.get(name, 0)))

    def _function(self, answer: int) -> Callable[..., int]:
        def called(*_arguments: Any) -> int:
            return answer

        return called


@pytest.fixture
def at_exit(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """What is left for the end of the process."""
    left = list[Any]()
    monkeypatch.setattr(atexit, "register", left.append)
    return left


def load(monkeypatch: pytest.MonkeyPatch, open_it: Callable[[str], Any]) -> Any:
    """Loads it anew, where each name opens what `open_it` says."""
    monkeypatch.setattr(ctypes, "CDLL", open_it)
    return libsrt.load.__wrapped__()


def test_the_library_is_started_and_cleaned_up_at_the_end(
    monkeypatch: pytest.MonkeyPatch, at_exit: list[Any]
) -> None:
    library = Library()
    assert load(monkeypatch, lambda _name: library) is library
    assert at_exit == [library.srt_cleanup]


@pytest.mark.parametrize(
    ("library", "text"),
    [
        (Library(lacks="srt_getversion"), "libsrt is too old: .*srt_getversion"),
        (Library(lacks="srt_bind_acquire"), "libsrt is too old: .*srt_bind_acquire"),
        (Library(0x010401), "libsrt 1.4.1 is older than 1.4.2"),
        (Library(starts=-1), "libsrt can't be started"),
    ],
)
def test_a_library_that_can_not_be_used_is_reported(
    monkeypatch: pytest.MonkeyPatch, at_exit: list[Any], library: Library, text: str
) -> None:
    with pytest.raises(LibsrtMissingError, match=text) as caught:
        load(monkeypatch, lambda _name: library)
    assert caught.value.remedy == "Type: sudo apt-get install libsrt1.5-gnutls"
    assert at_exit == []


def test_it_is_the_very_library_that_gstreamer_has_loaded(tmp_path: Path) -> None:
    """Another one, by a name of which libsrt.py knows, would be a second libsrt in the process."""
    libsrt.load()
    other = tmp_path / "libsrt-gnutls.so.1.5"
    shutil.copy(min(MAPPED.findall(Path("/proc/self/maps").read_text(encoding="utf-8"))), other)
    program = [sys.executable, "-c", BOTH_LOADED, str(other)]
    done = subprocess.run(program, cwd=ROOT, capture_output=True, text=True, timeout=60, check=True)
    mapped = set(MAPPED.findall(done.stdout))
    assert len(mapped) == 1
    assert str(other) not in mapped


def test_without_any_that_opens_there_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    tried = list[str]()

    def fail(name: str) -> None:
        tried.append(name)
        raise OSError("cannot open shared object file")

    with pytest.raises(LibsrtMissingError, match="libsrt is not installed") as caught:
        load(monkeypatch, fail)
    assert tried[-len(libsrt._NAMES) :] == list(libsrt._NAMES)
    assert caught.value.remedy == "Type: sudo apt-get install libsrt1.5-gnutls"


def test_the_next_name_is_tried_where_one_does_not_open(
    monkeypatch: pytest.MonkeyPatch, at_exit: list[Any]
) -> None:
    library = Library()

    def only_the_last(name: str) -> Library:
        if name != libsrt._NAMES[-1]:
            raise OSError("cannot open shared object file")
        return library

    assert load(monkeypatch, only_the_last) is library
    assert at_exit == [library.srt_cleanup]


@pytest.mark.parametrize(
    ("number", "exhausted", "remedy"),
    [
        (errno.EMFILE, True, "Type: ulimit -n"),
        (errno.ENFILE, True, "fs.file-max"),
        (errno.EACCES, False, "may open UDP sockets"),
        (errno.EAFNOSUPPORT, False, "IPv6"),
    ],
)
def test_each_reason_for_no_socket_has_its_remedy(*, number: int, exhausted: bool, remedy: str) -> None:
    error = LocalSocketError(OSError(number, os.strerror(number)))
    assert str(error) == f"libsrt gets no socket: {os.strerror(number)}"
    assert error.exhausted is exhausted
    assert remedy in error.remedy
    assert "apt-get" not in error.remedy
