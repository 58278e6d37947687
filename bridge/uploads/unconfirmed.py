"""The copies that the recorder may not have as they are. Pure: knows names, no states.

A report has room for few, and may be lost on its way; the recorder's list is read again and again, and shows
what has arrived.

| what happens | what follows |
|---|---|
| a copy changes | it is among the first of the next report |
| it was reported | it goes behind the others: each has its turn |
| the list has it as it is | it is confirmed |
| the list has it otherwise | it is reported again |
| the list was read to its end without it | it is forgotten: the recording is deleted |
"""

from collections import OrderedDict


class Unconfirmed:
    """Recordings whose copies are to be reported, in the order of their turns."""

    def __init__(self) -> None:
        self._listings: OrderedDict[str, int] = OrderedDict()
        """By recording: in which listing it was seen or changed last."""
        self._listing = 0

    def __len__(self) -> int:
        return len(self._listings)

    def __contains__(self, recording_id: str) -> bool:
        return recording_id in self._listings

    def changed(self, recording_id: str) -> None:
        """Takes a copy that has changed."""
        self._listings[recording_id] = self._listing
        self._listings.move_to_end(recording_id, last=False)

    def removed(self, recording_id: str) -> None:
        """Takes that there is no copy any more."""
        self._listings.pop(recording_id, None)

    def next(self, most: int) -> list[str]:
        """Returns those whose turn it is, so many at most; their next turn is after the others'."""
        turn = list(self._listings)[:most]
        for recording_id in turn:
            self._listings.move_to_end(recording_id)
        return turn

    def begin_listing(self) -> None:
        """Takes that the recorder's list is read from its beginning."""
        self._listing += 1

    def listed(self, recording_id: str, *, confirmed: bool) -> None:
        """Takes a recording of the list, and whether it has the copy as it is."""
        if confirmed:
            self._listings.pop(recording_id, None)
        else:
            self._listings[recording_id] = self._listing

    def end_listing(self) -> None:
        """Takes that the list was read to its end."""
        for recording_id in [key for key, seen in self._listings.items() if seen < self._listing]:
            del self._listings[recording_id]
