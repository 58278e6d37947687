"""What is read of a message besides its payload, which another client of the hub may choose byte by byte."""

import pytest

from fleet.incoming import (
    LARGEST_HEADERS,
    LONGEST_SUBJECT,
    read_headers,
    read_place,
    read_reply,
    read_subject,
)


@pytest.mark.parametrize(
    ("block", "headers"),
    [
        (b"NATS/1.0\r\n\r\n", {}),
        (b"NATS/1.0 503\r\n\r\n", {"Status": "503"}),
        (b"NATS/1.0 404 No Messages\r\n\r\n", {"Status": "404", "Description": "No Messages"}),
        (
            b"NATS/1.0 100 Idle Heartbeat\r\nNats-Last-Consumer: 1016\r\n\r\n",
            {"Status": "100", "Description": "Idle Heartbeat"},
        ),
        (b"NATS/1.0\r\nKV-Operation: DEL\r\n\r\n", {"KV-Operation": "DEL"}),
        (b"NATS/1.0\r\nOther: x\r\nStatus: 503\r\n\r\n", {}),
        (b"NATS/1.0 409 \xff\r\n\r\n", {"Status": "409", "Description": "\ufffd"}),
        (b"NATS/1.0\r\nno colon\r\n: no name\r\n\xff: x\r\nKV-Operation:\r\n", {"KV-Operation": ""}),
    ],
)
def test_what_programs_use_is_kept(block: bytes, headers: dict[str, str]) -> None:
    assert read_headers(block) == headers


@pytest.mark.parametrize(
    "block",
    [
        b"NATS/1.0 \xff\xff\xff\r\n\r\n",
        b"NATS/1.0 5 x\r\n\r\n",
        b"NATS/1.0 5034\r\n\r\n",
        b"NATS/2.0\r\n\r\n",
        b"N",
        b"\x00" * 30,
        b"NATS/1.0\r\n" + b"a: b\r\n" * LARGEST_HEADERS,
    ],
)
def test_what_is_not_readable_is_none(block: bytes) -> None:
    assert read_headers(block) is None


def test_values_are_cut() -> None:
    headers = read_headers(b"NATS/1.0 409 " + b"x" * 3000 + b"\r\nKV-Operation: " + b"y" * 900 + b"\r\n\r\n")
    assert headers is not None
    assert {name: len(value) for name, value in headers.items()} == {
        "Status": 3,
        "Description": 256,
        "KV-Operation": 256,
    }


def test_a_subject_that_is_no_text_is_none_of_ours_and_has_no_answer() -> None:
    assert read_subject(b"fleet.r1.cmd.c1") == ("fleet.r1.cmd.c1", True)
    assert read_subject(b"fleet.r1.cmd.\xff") == ("fleet.r1.cmd.\ufffd\ufffd", False)
    assert read_subject(b"x" * 5000) == ("x" * LONGEST_SUBJECT + "\ufffd", False)
    assert read_reply(b"_INBOX_r1.a.1") == ("_INBOX_r1.a.1", True)
    assert read_reply(b"_INBOX_r1.\xff") == ("", False)
    assert read_reply(b"x" * 5000) == ("", False)


_PLACE = (
    b"Nats-Stream: s\r\nNats-Subject: fleet.r1.ev.run.1\r\nNats-Sequence: 7\r\n"
    b"Nats-Time-Stamp: 2026-01-31T12:00:00Z\r\nNats-Num-Pending: 3\r\nNats-Last-Sequence: 0\r\n\r\n"
)


@pytest.mark.parametrize(
    "before",
    [
        b"NATS/1.0\r\n",
        b"NATS/1.0 204 EOB\r\nNats-Sequence: 1\r\nNats-Subject: fleet.r2.ev.run.1\r\n",
        # As servers do with headers that do not end as they have to.
        b"NATS/1.0\r\nNats-Sequence:",
        b"\xff" * 60_000 + b"\r\nNats-Subject: other\r\n",
    ],
)
def test_the_place_in_a_stream_is_what_the_hub_says(before: bytes) -> None:
    assert read_place(before + _PLACE) == {
        "Nats-Subject": "fleet.r1.ev.run.1",
        "Nats-Sequence": "7",
        "Nats-Time-Stamp": "2026-01-31T12:00:00Z",
        "Nats-Num-Pending": "3",
        "Nats-Last-Sequence": "0",
    }


def test_what_an_older_hub_does_not_say_its_sender_can_not_say() -> None:
    said = b"NATS/1.0\r\nNats-Num-Pending: 9\r\nNats-Last-Sequence: 0\r\n"
    place = read_place(said + _PLACE.partition(b"Nats-Num")[0])
    assert set(place) == {"Nats-Subject", "Nats-Sequence", "Nats-Time-Stamp"}


def test_a_message_that_is_of_no_stream_has_no_place() -> None:
    assert read_place(b"NATS/1.0 404 Message Not Found\r\n\r\n") == {}
    assert read_place(b"NATS/1.0 204 EOB\r\nNats-Num-Pending: 0\r\nNats-Last-Sequence: 6\r\n\r\n") == {}
