"""A recording with all of its files: the robot lists them a page at a time, and adds some meanwhile.

| what happens | what follows |
|---|---|
| a recording that has ended changes between two pages | the list is begun anew, LISTS times at the most |
| the robot lists fewer files than it says there are | `Unsupported`: it is older than the pages |
| the pages do not end | `GatewayFailed` after MOST_PAGES |

What this returns is whole, so that an export or an upload of it is.
"""

from collections.abc import Awaitable, Callable
from dataclasses import replace
from typing import Final

from console.client.errors import GatewayFailed, InvalidRequest, Unsupported
from console.client.results import Recording, RecordingFile, RecordingFound, RecordingState

MOST_PAGES: Final = 1000
"""A page has up to 10000 files, and rarely fewer than 1000."""
LISTS: Final = 3
_ENDED: Final = frozenset({RecordingState.COMPLETE, RecordingState.RECOVERED, RecordingState.FAULTED})

Page = Callable[[str], Awaitable[RecordingFound]]


async def with_all_files(page: Page) -> Recording:
    """Returns the recording with its files and gaps.

    Args:
        page: Returns the page that a token leads to, the first one without.

    Raises:
        GatewayError: Of a call; or the list can't be had whole.
    """
    for _ in range(LISTS):
        if found := await _listed(page):
            return found
    raise GatewayFailed("the recording changes while the robot lists its files", "Try again in a moment")


async def _listed(page: Page) -> Recording | None:
    """Returns the recording with its files; None if it has changed meanwhile."""
    found = first = await page("")
    files = list(first.recording.files)
    for _ in range(MOST_PAGES):
        if not found.next_page_token:
            return _checked(first.recording, found.recording, files)
        try:
            found = await page(found.next_page_token)
        except InvalidRequest:
            return None  # The file that the token names is gone.
        if _differ(first.recording, found.recording):
            return None
        files += found.recording.files
    raise GatewayFailed(f"the robot lists the files of {first.recording.id} without an end")


def _checked(first: Recording, newest: Recording, files: list[RecordingFile]) -> Recording | None:
    if len(files) < newest.file_count:
        raise Unsupported(
            f"the robot lists only {len(files)} of the {newest.file_count} files of {newest.id}",
            "Update robot-gateway and robot-recorder on the robot, or copy the folder there by hand",
        )
    if len({file.name for file in files}) < len(files):
        return None
    return replace(newest, files=tuple(files), gaps=first.gaps)


def _differ(first: Recording, newest: Recording) -> bool:
    """Whether these are not pages of one list. To one that is still written, files may only be added."""
    if first.state not in _ENDED and newest.state not in _ENDED:
        return False
    return _content(first) != _content(newest)


def _content(recording: Recording) -> tuple[object, ...]:
    return recording.state, recording.sha256, recording.size, recording.file_count
