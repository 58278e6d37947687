"""What robotctl drive asks of a terminal, on a real pseudoterminal, and how it leaves it."""

import asyncio
import os
import pty
import select
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from console.cli import drive_terminal
from console.cli.drive_keys import ASK_ALL, Action, Hands
from console.cli.keyboard import Keyboard
from tests.support.eventually import eventually
from tests.support.kitty import ALL_FLAGS, Kitty


class Screen:
    """The other end, where the keys are."""

    def __init__(self, master: int, kitty: Kitty | None) -> None:
        self._master, self.kitty = master, kitty
        self.written = ""

    def press(self, keys: str) -> None:
        """Presses keys."""
        os.write(self._master, keys.encode())

    def read(self) -> None:
        """Reads what the program has written, and answers."""
        written = os.read(self._master, 4096).decode()
        self.written += written
        if self.kitty:
            os.write(self._master, self.kitty.answer(written).encode())


def ignored(actions: list[Action]) -> None:
    """Takes what is typed while an answer is awaited."""


class HeldUp(Kitty):
    """A terminal whose newest answer is held up, once it has answered all that a program begins with."""

    held_up = ""

    def answer(self, written: str) -> str:
        """What it answers at once; the rest is what is held up."""
        answer = super().answer(written)
        if self.speaks and not self.pushed:
            return answer
        self.held_up += answer
        return ""


@asynccontextmanager
async def screen(
    monkeypatch: pytest.MonkeyPatch, kitty: Kitty | None, *, within_s: float = 15.0
) -> AsyncIterator[Screen]:
    """The terminal of this process, while the block lasts; without `kitty` it answers nothing.

    An answer that is expected is waited for, however late a stalled machine makes it.
    """
    monkeypatch.setattr(drive_terminal, "_ANSWER_WITHIN_S", within_s)
    master, slave = pty.openpty()
    loop = asyncio.get_running_loop()
    shown = Screen(master, kitty)
    with os.fdopen(slave, "r+b", buffering=0) as raw, monkeypatch.context() as patch:
        for name, mode in (("stdin", "r"), ("stderr", "w")):
            patch.setattr(f"sys.{name}", os.fdopen(os.dup(raw.fileno()), mode))
        loop.add_reader(master, shown.read)
        try:
            yield shown
        finally:
            loop.remove_reader(master)
            os.close(master)


async def has(shown: Screen, code: str, *, pushed: bool = False) -> None:
    """Waits until this has arrived, and flags are in force or not."""

    async def found() -> tuple[bool, bool]:
        return code in shown.written, bool(shown.kitty and shown.kitty.pushed)

    await eventually(found, lambda found: found == (True, pushed), f"{code!r}, flags in force: {pushed}")


@pytest.mark.parametrize("knows", [ALL_FLAGS, 10, 13, 0])
async def test_it_reports_releases_while_the_block_lasts_where_it_says_so(
    monkeypatch: pytest.MonkeyPatch, knows: int
) -> None:
    kitty = Kitty(knows)
    async with screen(monkeypatch, kitty) as shown:
        keyboard = Keyboard()
        keyboard.take()
        async with drive_terminal.reporting_keys(keyboard, ignored) as hands:
            assert hands.releases == (knows & 10 == 10)
            await has(shown, "\x1b[?1004h", pushed=hands.releases)
        keyboard.give_back()
        await has(shown, "\x1b[?1004l")


async def test_a_terminal_that_does_not_speak_the_protocol_gets_none_of_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async with screen(monkeypatch, None, within_s=0.2) as shown:
        keyboard = Keyboard()
        keyboard.take()
        async with drive_terminal.reporting_keys(keyboard, ignored) as hands:
            assert not hands.releases
            assert not hands.ask(time.monotonic() + 1.0), "it never answers"
        keyboard.give_back()
        await has(shown, "\x1b[?1004l")
        assert shown.written == "\x1b[?u\x1b[5n\x1b[c\x1b[?1004h\x1b[?1004l"


async def test_an_error_leaves_the_terminal_as_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    kitty = Kitty()

    async def fail() -> None:
        keyboard = Keyboard()
        keyboard.take()
        async with drive_terminal.reporting_keys(keyboard, ignored):
            assert kitty.pushed
            raise ValueError("whatever")

    async with screen(monkeypatch, kitty) as shown:
        with pytest.raises(ValueError, match="whatever"):
            await fail()
        await has(shown, "\x1b[?1004l")


async def test_a_terminal_that_falls_silent_when_it_is_asked_again_gets_its_flags_back(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Silent(Kitty):
        def answer(self, written: str) -> str:
            answer = super().answer(written)
            return "" if self.pushed else answer

    kitty = Silent()
    async with screen(monkeypatch, kitty, within_s=0.2) as shown:
        keyboard = Keyboard()
        keyboard.take()
        async with drive_terminal.reporting_keys(keyboard, ignored) as hands:
            assert not hands.releases
            assert not hands.ask(time.monotonic() + 1.0), "it does not answer"
        await has(shown, "\x1b[?1004l")


async def test_an_answer_counts_that_comes_while_the_program_stands_still(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its time has run out, and it is there."""
    async with screen(monkeypatch, Kitty(), within_s=0.0) as shown:
        keyboard = Keyboard()
        keyboard.take()
        write = drive_terminal._write

        def write_and_have_it_answered(codes: str) -> None:
            write(codes)
            shown.read()
            if codes == ASK_ALL:
                assert select.select([keyboard.fileno], [], [], 15)[0]

        monkeypatch.setattr(drive_terminal, "_write", write_and_have_it_answered)
        async with drive_terminal.reporting_keys(keyboard, ignored) as hands:
            assert hands.releases


@pytest.mark.parametrize("speaks", [True, False])
async def test_no_answer_is_left_for_the_shell(monkeypatch: pytest.MonkeyPatch, speaks: bool) -> None:
    """Without the protocol it is asked for what every terminal answers."""
    async with screen(monkeypatch, Kitty(speaks=speaks)) as shown:
        keyboard = Keyboard()
        keyboard.take()
        async with drive_terminal.reporting_keys(keyboard, ignored) as hands:
            assert hands.releases == speaks
            request = hands.ask(time.monotonic() + 1.0)
            assert request == ("\x1b[?u" if speaks else "\x1b[c")
            drive_terminal.ask(request)
        assert not hands.awaits_answer
        assert not select.select([keyboard.fileno], [], [], 0)[0]
        keyboard.give_back()
        await has(shown, "\x1b[?1004l")


async def test_space_counts_also_while_the_last_answer_is_awaited(monkeypatch: pytest.MonkeyPatch) -> None:
    late: list[Action] = []
    async with screen(monkeypatch, Kitty(speaks=False)) as shown:
        keyboard = Keyboard()
        keyboard.take()
        async with drive_terminal.reporting_keys(keyboard, late.extend) as hands:
            shown.press(" ")
            drive_terminal.ask(hands.ask(time.monotonic() + 1.0))
        keyboard.give_back()
    assert late == [Action.STOP]


@pytest.mark.parametrize("speaks", [True, False], ids=["second answer", "first answer"])
async def test_space_and_x_count_at_once_while_the_first_answers_are_awaited(
    monkeypatch: pytest.MonkeyPatch, speaks: bool
) -> None:
    """The defect: what was typed before them was dropped."""
    kitty, taken = HeldUp(speaks=speaks), list[Action]()

    async def taken_now() -> list[Action]:
        return taken

    async def drive() -> Hands:
        keyboard = Keyboard()
        keyboard.take()
        async with drive_terminal.reporting_keys(keyboard, taken.extend) as hands:
            return hands

    async with screen(monkeypatch, kitty) as shown:
        driving = asyncio.create_task(drive())
        await has(shown, ASK_ALL, pushed=speaks)
        shown.press("w\x1b[32;1:1u\x1b[120;1:1u" if speaks else "w x")
        await eventually(taken_now, lambda taken: taken == [Action.STOP, Action.QUIT], "Space and x")
        assert not driving.done(), "the answer is still awaited"
        shown.press(kitty.held_up)
        hands = await driving
    assert hands.releases == speaks
    assert hands.steering(time.monotonic()) is None, "no motion begins before"


@pytest.mark.parametrize("knows", ["the status", "no status"])
async def test_a_terminal_is_asked_only_for_what_it_answers(
    monkeypatch: pytest.MonkeyPatch, knows: str
) -> None:
    class WithoutStatus(Kitty):
        def answer(self, written: str) -> str:
            return super().answer(written).replace("\x1b[0n", "")

    kitty = (Kitty if knows == "the status" else WithoutStatus)(speaks=False)
    async with screen(monkeypatch, kitty):
        keyboard = Keyboard()
        keyboard.take()
        async with drive_terminal.reporting_keys(keyboard, ignored) as hands:
            requests = ""
            for number in range(1, 14):
                requests += hands.ask(time.monotonic() + number)
                hands.take("\x1b[?62;c\x1b[0n", time.monotonic())
        keyboard.give_back()
    assert ("\x1b[5n" in requests) == (knows == "the status")


async def test_ctrl_s_holds_up_neither_the_program_nor_its_keys(monkeypatch: pytest.MonkeyPatch) -> None:
    """The defect: the next request to the terminal hung, and with it the loop that reads Space."""
    async with screen(monkeypatch, None) as shown:
        keyboard = Keyboard()
        keyboard.take()
        try:
            shown.press("\x13 ")
            assert keyboard.typed() == "\x13 "
            os.set_blocking(keyboard.fileno, False)
            os.write(keyboard.fileno, b"asked")
        finally:
            keyboard.give_back()
        await has(shown, "asked")
