"""The newest state: written by the threads that know something, read by whoever shows it."""

import threading
from collections.abc import Callable, Iterable
from dataclasses import replace

from console.client import OverlaySnapshot
from console.monitor.event_lines import EventLine
from console.monitor.link import Link
from console.monitor.state import MonitorState, Request, Wish


class Newest:
    """Replaces one frozen state by the next; each change is whole.

    Args:
        first: the state to begin with.
        on_news: called after each change, in the thread that made it; must only hand over.
    """

    def __init__(self, first: MonitorState, on_news: Callable[[], None]) -> None:
        self._state = first
        self._on_news = on_news
        self._changing = threading.Lock()

    def get(self) -> MonitorState:
        """What is known now."""
        return self._state

    def set_link(self, link: Link) -> None:
        """The connection has changed."""
        with self._changing:
            self._state = replace(self._state, link=link)
        self._on_news()

    def set_snapshot(self, link: Link, snapshot: OverlaySnapshot, received_s: float) -> None:
        """The robot has answered."""
        with self._changing:
            self._state = replace(self._state, link=link, snapshot=snapshot, received_s=received_s)
        self._on_news()

    def add_events(self, lines: Iterable[EventLine]) -> None:
        """Something has happened."""
        with self._changing:
            self._state = replace(self._state, events=self._state.events.with_lines(lines))
        self._on_news()

    def begin_request(self, wish: Wish) -> bool:
        """Notes that the robot is asked; False while an earlier request is under way. Nobody is told."""
        with self._changing:
            if self._state.request and self._state.request.under_way:
                return False
            self._state = replace(self._state, request=Request(wish))
            return True

    def end_request(self, request: Request) -> None:
        """The robot has answered, or has not."""
        with self._changing:
            self._state = replace(self._state, request=request)
        self._on_news()
