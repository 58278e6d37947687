"""Answers the operator: takes the wish, waits for what becomes of it as long as it may, and says so."""

from typing import Final

from gateway.preview_link.link import PreviewLink
from gateway.preview_link.wish import Wish
from gateway.status.preview import PreviewState, PreviewView, Profile

DEADLINE_MARGIN_S: Final = 0.2
"""How long before the caller's deadline the answer leaves, so that it still arrives."""


class PreviewControl:
    """Switches the preview on the operator's behalf.

    Args:
        settle_s: the longest wait for a wish to come to something.
    """

    def __init__(self, link: PreviewLink, settle_s: float) -> None:
        self._link = link
        self._settle_s = settle_s

    async def switch(self, *, enabled: bool, profile: Profile | None, remaining_s: float | None) -> str:
        """Makes it the newest wish, unless it already is.

        Args:
            enabled: whether there shall be a preview.
            profile: None keeps the current one.
            remaining_s: until the caller's deadline; None when there is none.

        Returns:
            What became of it, for a person to read. The link's view tells the same to programs.
        """
        wish = self._link.wish
        same = wish.enabled == enabled and (not enabled or profile in {None, wish.profile})
        state = self._link.view.state
        if same and state is PreviewState.RUNNING and self._link.settled(wish):
            return f"preview is already running, {_name(wish)}; nothing was touched"
        # Asking again for a preview that is faulted is worth an attempt now.
        if not same or (enabled and state is PreviewState.FAULTED):
            wish = self._link.ask(enabled=enabled, profile=profile)
        await self._link.wait_until_settled(wish, self._patience_s(remaining_s))
        return _sentence(wish, self._link.wish, self._link.view)

    def _patience_s(self, remaining_s: float | None) -> float:
        if remaining_s is None:
            return self._settle_s
        return max(0.0, min(self._settle_s, remaining_s - DEADLINE_MARGIN_S))


def _sentence(wish: Wish, newest: Wish, view: PreviewView) -> str:
    if newest.revision != wish.revision:
        instead = f"on, {_name(newest)}" if newest.enabled else "off"
        return f"replaced by a newer request: preview {instead}"
    return _on(wish, view) if wish.enabled else _off(view)


def _on(wish: Wish, view: PreviewView) -> str:
    match view.state:
        case PreviewState.RUNNING:
            return f"preview is running, {_name(wish)}"
        case PreviewState.FAULTED:
            return f"preview is not delivering yet and the robot keeps trying: {view.last_error}"
        case _:
            return f"preview is on its way ({view.state.value}); ask for the status to see it arrive"


def _off(view: PreviewView) -> str:
    match view.state:
        case PreviewState.DISABLED if view.service_reachable:
            return "preview is off"
        case PreviewState.DISABLED:
            return "preview is off; its service is unreachable and will be told when it comes back"
        case PreviewState.FAULTED:
            return f"preview could not be turned off: {view.last_error}"
        case _:
            return f"preview is being turned off ({view.state.value}); ask for the status to see it end"


def _name(wish: Wish) -> str:
    return wish.profile.value if wish.profile else "no profile"
