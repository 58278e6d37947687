"""The parts of robotctl watch on a terminal that need no terminal: keys, wishes, the picture's height."""

import io
from collections.abc import Callable
from dataclasses import replace

import pytest
from rich.console import Console
from rich.text import Text

from console.cli.live.keys import Key, keys_in
from console.cli.live.picture import Fitted
from console.cli.live.wishes import Wish, Wishes
from console.client import PreviewChange, PreviewProfile, PreviewState, PreviewStatus, Unreachable
from console.client.mapping.methods import GET_SYSTEM_STATUS
from console.presentation.severity_style import SeverityStyle
from omniseer.gateway.v1.system_status_pb2 import SystemStatus

PREVIEW = GET_SYSTEM_STATUS.decode(SystemStatus().SerializeToString()).preview


class Clock:
    """Goes when told."""

    now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def wishes(clock: Callable[[], float]) -> Wishes:
    return Wishes(clock)


def preview(state: PreviewState, profile: PreviewProfile = PreviewProfile.BALANCED) -> PreviewStatus:
    return replace(PREVIEW, state=state, profile=profile)


def said(wishes: Wishes) -> str:
    note = wishes.note()
    return note.text if note else ""


@pytest.mark.parametrize(
    ("typed", "keys"),
    [
        ("p", [Key.TOGGLE]),
        ("123q", [Key.LOW_BW, Key.BALANCED, Key.HIGH_QUALITY, Key.QUIT]),
        ("P Q", [Key.TOGGLE, Key.QUIT]),
        ("xyz 456\n\t", []),
        ("\x1b[A\x1b[1~\x1b[1;5C\x1bOP\x1bp\x1b", []),
        ("\x1b[1~1", [Key.LOW_BW]),
        ("\ufffdp", [Key.TOGGLE]),
    ],
)
def test_what_is_typed(typed: str, keys: list[Key]) -> None:
    assert list(keys_in(typed)) == keys


@pytest.mark.parametrize(
    ("state", "wish"),
    [
        (PreviewState.DISABLED, Wish(True)),
        (PreviewState.STOPPING, Wish(True)),
        (PreviewState.UNKNOWN, Wish(True)),
        (PreviewState.STARTING, Wish(False)),
        (PreviewState.RUNNING, Wish(False)),
        (PreviewState.FAULTED, Wish(False)),
    ],
)
def test_p_wants_the_other_thing(wishes: Wishes, state: PreviewState, wish: Wish) -> None:
    assert wishes.press(Key.TOGGLE, preview(state)) == wish
    offered = {key: does for key, does, _ in Wishes().help(preview(state))}
    assert offered[Key.TOGGLE] == ("preview on" if wish.enabled else "preview off")


def test_a_profile_is_switched_while_it_runs_and_marked_while_it_does_not(wishes: Wishes) -> None:
    assert wishes.press(Key.LOW_BW, preview(PreviewState.DISABLED)) is None
    assert [key for key, _, is_so in wishes.help(preview(PreviewState.DISABLED)) if is_so] == [Key.LOW_BW]
    assert wishes.press(Key.TOGGLE, preview(PreviewState.DISABLED)) == Wish(True, PreviewProfile.LOW_BW)
    running = preview(PreviewState.RUNNING, PreviewProfile.LOW_BW)
    wishes.done(PreviewChange(accepted=True, message="preview is running", preview=running))
    assert wishes.press(Key.HIGH_QUALITY, running) == Wish(True, PreviewProfile.HIGH_QUALITY)


def test_one_thing_at_a_time(wishes: Wishes) -> None:
    off = preview(PreviewState.DISABLED)
    assert wishes.press(Key.TOGGLE, off)
    assert wishes.press(Key.TOGGLE, off) is None
    assert said(wishes) == "preview on: the robot is asked ..."
    wishes.done(PreviewChange(accepted=True, message="preview is on its way", preview=off))
    assert wishes.press(Key.TOGGLE, off)


def test_good_news_goes_soon_and_bad_news_later(wishes: Wishes, clock: Clock) -> None:
    off = preview(PreviewState.DISABLED)
    wishes.press(Key.TOGGLE, off)
    wishes.done(PreviewChange(accepted=True, message="preview is running", preview=off))
    assert said(wishes) == "preview is running"
    clock.now_s += 6
    assert said(wishes) == ""
    wishes.press(Key.TOGGLE, off)
    wishes.done(PreviewChange(accepted=False, message="being serviced", preview=off))
    clock.now_s += 6
    note = wishes.note()
    assert note
    assert (note.text, note.style) == ("preview on: the robot refused: being serviced", SeverityStyle.BAD)
    clock.now_s += 20
    assert wishes.note() is None


def test_what_was_not_heard_says_what_to_do(wishes: Wishes) -> None:
    wishes.press(Key.TOGGLE, preview(PreviewState.RUNNING))
    wishes.done(Unreachable("the link went silent", "Walk closer"))
    assert said(wishes) == "preview off: not done, the link went silent. Walk closer"


@pytest.mark.parametrize(("height", "middle"), [(20, 10), (14, 10), (13, 9), (8, 4), (2, 1)])
def test_the_middle_gives_way(height: int, middle: int) -> None:
    console = Console(file=io.StringIO(), width=60, height=height)
    body = Text("\n".join(f"row {number}" for number in range(10)))
    console.print(Fitted(Text("head\n"), body, Text("foot\nkeys")))
    assert isinstance(console.file, io.StringIO)
    lines = console.file.getvalue().splitlines()
    assert (lines[0], lines[-1]) == ("head", "keys")
    assert len(lines) == 4 + middle
    if middle < 10:
        assert lines[-3].startswith("... ")
        assert f"{11 - middle} more lines" in lines[-3]
