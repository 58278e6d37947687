"""The recordings that are to be copied and find no place in the full queue. Pure: knows names, no states.

Each time the recorder's list is read, they compete for the places again; a count is that of the last list.
"""


class LeftOut:
    """Recordings without a place, over one reading of the recorder's list.

    Attributes:
        count: how many there were when the list was last read to its end.
    """

    def __init__(self) -> None:
        self._names = set[str]()
        self.count = 0

    def begin_listing(self) -> None:
        """Takes that the recorder's list is read from its beginning."""
        self._names.clear()

    def add(self, recording_id: str) -> None:
        """Takes a recording that has no place, or has lost its own to another one."""
        self._names.add(recording_id)

    def remove(self, recording_id: str) -> None:
        """Takes that a recording has a place."""
        self._names.discard(recording_id)

    def end_listing(self) -> bool:
        """Takes that the list was read to its end; returns whether the first came, or the last went."""
        before, self.count = self.count, len(self._names)
        return bool(before) is not bool(self.count)
