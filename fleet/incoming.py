"""What is read of a message besides its payload: subject, reply subject and headers. Pure.

Another client that may publish into a stream chooses all three, and the stream delivers them again after
every new connection. The NATS library decodes them strictly, so that a byte that is no UTF-8 would end the
connection each time, and keeps every header, of which a message may have half a MiB.

| what comes | what follows |
|---|---|
| a subject that is no UTF-8, or longer than 1 KiB | cut, with U+FFFD at its end, as none of ours; counted |
| such a reply subject | none; counted |
| headers larger than 4 KiB, of another version, or with a status that is no number | no headers; counted |
| other headers than those below | they are not kept |
| headers of a sender that look like the hub's | the hub's own are behind them, and count (`read_place`) |
| a status in the name of the hub, of another client | none: `Message.status`, and `consuming.py` |
"""

import re
from typing import Final

STATUS: Final = "Status"
"""JetStream's code of a message without content, of the first line (ADR-4); a header of that name is none."""
DESCRIPTION: Final = "Description"
OPERATION: Final = "KV-Operation"
"""Of a change in a bucket (ADR-8)."""
STORED_AS: Final = "Nats-Subject"
"""Of a stored message that a direct get answers with (ADR-31), as are the next ones: its subject."""
SEQUENCE: Final = "Nats-Sequence"
TAKEN: Final = "Nats-Time-Stamp"
PENDING: Final = "Nats-Num-Pending"
"""Messages still to come; servers before 2.11 don't say it."""
PREVIOUS: Final = "Nats-Last-Sequence"
"""Sequence of the message before, in the same answer."""
LARGEST_HEADERS: Final = 4096
"""Bytes; those of JetStream have some hundred."""
LONGEST_SUBJECT: Final = 1024
"""Bytes. Ours have some hundred, and so have those by which JetStream is answered."""
_LONGEST_VALUE: Final = 256
_REPLACED: Final = "\N{REPLACEMENT CHARACTER}"
_VERSION: Final = b"NATS/1.0"
_STATUS: Final = re.compile(rb"[0-9]{3}")
_PLACE: Final = {each.encode(): each for each in (SEQUENCE, TAKEN, PENDING, PREVIOUS)}
_FIRST_OF_PLACE: Final = f"\r\n{STORED_AS}:".encode()


def read_headers(block: bytes) -> dict[str, str] | None:
    """Returns what programs of a fleet use of a message's headers; None if they are not readable."""
    if len(block) > LARGEST_HEADERS or not block.startswith(_VERSION):
        return None
    first, *lines = block[len(_VERSION) :].split(b"\r\n")
    status, _, description = first.strip().partition(b" ")
    found: dict[str, str] = {}
    if status:
        if not _STATUS.fullmatch(status):
            return None
        found[STATUS] = status.decode("ascii")
        if description:
            found[DESCRIPTION] = _value(description)
    for line in lines:
        name, colon, value = line.partition(b":")
        if colon and name == OPERATION.encode():
            found[OPERATION] = _value(value)
    return found


def read_place(block: bytes) -> dict[str, str]:
    """Returns what the hub says of a stored message: its subject, and its place in the stream.

    The hub adds it behind the headers of the sender, which may be of any size and have the same names.
    """
    begin = block.rfind(_FIRST_OF_PLACE)
    if begin < 0:
        return {}
    subject, *lines = block[begin + len(_FIRST_OF_PLACE) :].split(b"\r\n")
    found = {STORED_AS: read_subject(subject.strip())[0]}
    for line in lines:
        name, _, value = line.partition(b":")
        if name in _PLACE:
            found[_PLACE[name]] = _value(value)
    return found


def read_subject(subject: bytes) -> tuple[str, bool]:
    """Returns a subject as text, and whether it is readable."""
    text = subject[:LONGEST_SUBJECT].decode("utf-8", "replace")
    readable = len(subject) <= LONGEST_SUBJECT and _REPLACED not in text
    return (text if readable else text + _REPLACED), readable


def read_reply(reply: bytes) -> tuple[str, bool]:
    """Returns a reply subject as text, and whether it is readable; without that it can't be answered."""
    text, readable = read_subject(reply)
    return (text, True) if readable else ("", False)


def _value(raw: bytes) -> str:
    return raw.strip()[:_LONGEST_VALUE].decode("utf-8", "replace")
