"""The outbox's database on a real disk: order, bounds, and what is left of it after every kind of damage."""

import random
import resource
import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from bridge.events.values import Batch, DropReason, Event, Gap, Item, Position
from bridge.outbox import commands
from bridge.outbox.cursor import NAME as CURSOR
from bridge.outbox.database import DAMAGED_NAME, NAME, RESERVE_BYTES, Database
from bridge.outbox.errors import OutboxError

RUN = "run-1"
MIB = 1024 * 1024


def event(sequence: int, severity: int = 1, size: int = 20, run_id: str = RUN) -> Event:
    return Event(run_id, sequence, severity, sequence.to_bytes(4) * (size // 4))


def add(database: Database, *items: Item) -> None:
    database.open()
    database.append(items, database.facts.position, Position(items[-1].run_id, items[-1].last))


def taken(database: Database) -> list[Item]:
    """Everything in it, as a hub would get it."""
    items: list[Item] = []
    while batch := database.next_batch():
        items += batch.items
        database.delivered(batch, repeated=False)
    return items


@pytest.fixture
def database(tmp_path: Path) -> Iterator[Database]:
    made = Database(tmp_path, 64 * MIB)
    yield made
    made.close()


def opened(directory: Path, max_bytes: int = 64 * MIB) -> Database:
    return Database(directory, max_bytes)


def sent(database: Database) -> Batch:
    batch = database.next_batch()
    assert batch
    return batch


def test_events_leave_in_their_order_and_once(database: Database) -> None:
    add(database, *(event(number) for number in range(1, 151)))
    batches = []
    while batch := database.next_batch():
        batches.append((batch.first, batch.last))
        database.delivered(batch, repeated=False)
    assert batches == [(1, 64), (65, 128), (129, 150)]
    assert (database.facts.events, database.facts.sent, database.facts.dropped) == (0, 150, 0)


def test_a_batch_has_one_run_and_a_bounded_size(database: Database) -> None:
    add(database, event(1), event(2))
    add(database, Gap("run-2", 1, 0, DropReason.NO_LONGER_KEPT, earlier=True), event(1, run_id="run-2"))
    add(database, *(event(number, size=60_000, run_id="run-2") for number in range(2, 8)))
    found = []
    while batch := database.next_batch():
        found.append((batch.run_id, batch.first, batch.last))
        database.delivered(batch, repeated=False)
    assert found == [("run-1", 1, 2), ("run-2", 0, 5), ("run-2", 6, 7)]


def test_after_a_crash_the_same_batch_is_sent_again(tmp_path: Path) -> None:
    first = opened(tmp_path)
    add(first, event(1), event(2))
    batch = sent(first)
    add(first, event(3))
    first.close()
    again = opened(tmp_path)
    assert sent(again) == batch
    again.delivered(batch, repeated=True)
    assert sent(again).items == (event(3),)
    assert again.facts.position == Position(RUN, 3)
    again.close()


def test_what_is_in_flight_is_never_dropped(database: Database) -> None:
    add(database, event(1), event(2))
    batch = sent(database)
    add(database, event(3), event(4, severity=2), event(5))
    assert all(database.drop_oldest() for _ in range(3))
    assert sent(database) == batch
    database.delivered(batch, repeated=False)
    assert taken(database) == [Gap(RUN, 3, 5, DropReason.OUTBOX_FULL, worst=2)]
    assert database.facts.dropped == 3


def test_the_oldest_info_goes_first_then_the_oldest(database: Database) -> None:
    add(database, event(1, 3), event(2, 1), event(3, 2), event(4, 1), event(5, 2))
    orders = []
    for _ in range(3):
        assert database.drop_oldest()
        orders.append(database.facts.events)
    assert orders == [4, 3, 2]
    full = DropReason.OUTBOX_FULL
    assert taken(database) == [
        Gap(RUN, 1, 2, full, worst=3),
        event(3, 2),
        Gap(RUN, 4, 4, full, worst=1),
        event(5, 2),
    ]


def test_gaps_alone_are_joined_in_the_end(database: Database) -> None:
    add(database, Gap(RUN, 1, 4, DropReason.NO_LONGER_KEPT, earlier=True), event(5, 2))
    add(database, Gap("run-2", 1, 0, DropReason.NO_LONGER_KEPT, earlier=True), event(1, run_id="run-2"))
    while database.drop_oldest():
        pass
    assert taken(database) == [Gap("run-2", 1, 1, DropReason.OUTBOX_FULL, earlier=True)]


@pytest.mark.parametrize("size", [200, 3000])
def test_a_full_outbox_stays_within_its_bytes(tmp_path: Path, size: int) -> None:
    limit = RESERVE_BYTES + MIB
    database = opened(tmp_path, limit)
    largest = 0
    for start in range(1, 3_000_000 // size, 64):
        add(database, *(event(number, 1 + number % 3, size) for number in range(start, start + 64)))
        largest = max(largest, sum(path.stat().st_size for path in tmp_path.iterdir()))
    assert largest <= limit
    facts = database.facts
    assert facts.size <= MIB + 4096
    assert facts.position
    assert facts.events + facts.dropped == facts.position.sequence
    assert facts.events * size > MIB / 4, "the room is used"
    sequence = 0
    for item in taken(database):
        assert item.first == sequence + 1
        sequence = item.last
    assert sequence == facts.position.sequence
    database.close()


def test_gone_databases_go_on_after_what_was_sent(tmp_path: Path) -> None:
    database = opened(tmp_path)
    add(database, event(1), event(2))
    database.delivered(sent(database), repeated=False)
    add(database, event(3), event(4))
    batch = sent(database)
    add(database, event(5))
    database.close()
    for path in tmp_path.glob("outbox.db*"):
        path.unlink()
    again = opened(tmp_path)
    announced = sent(again)
    assert announced.items == (Gap(RUN, 3, 4, DropReason.OUTBOX_LOST),)
    assert (announced.run_id, announced.first) == (batch.run_id, batch.first), (
        "refused if the batch was there"
    )
    assert again.is_new()
    assert again.facts.position == Position(RUN, 4), "the gateway is asked for the fifth once more"
    again.close()


def test_without_a_cursor_nothing_is_known(tmp_path: Path) -> None:
    database = opened(tmp_path)
    add(database, event(1))
    sent(database)
    database.close()
    (tmp_path / CURSOR).write_bytes(b"{")
    again = opened(tmp_path)
    assert again.next_batch() is None
    assert again.facts.position is None
    assert again.is_new()
    assert (tmp_path / DAMAGED_NAME).exists()
    again.close()


def test_a_gap_of_the_unknown_finds_a_free_place(database: Database) -> None:
    add(database, Gap(RUN, 1, 3, DropReason.OUTBOX_LOST, earlier=True, probes=10))
    places = []
    while batch := database.next_batch():
        places.append((batch.first, batch.last))
        database.delivered(batch, repeated=True)
    assert places == [(0, 3), (1, 3), (2, 3), (3, 3)], "all of them are there: none is missing"


def test_cut_at_any_length_it_begins_again_and_announces_what_is_missing(tmp_path: Path) -> None:
    """Of 300 events 128 are delivered, and the next 64 may have been."""
    made = tmp_path / "made"
    database = opened(made)
    add(database, *(event(number, size=400) for number in range(1, 301)))
    for _ in range(2):
        database.delivered(sent(database), repeated=False)
    sent(database)
    database.close()
    whole = (made / NAME).read_bytes()
    lengths = [0, 1, 99, 100, 4095, 4096, *random.sample(range(len(whole)), 20)]
    for length in lengths:
        cut = tmp_path / "cut"
        shutil.copytree(made, cut)
        (cut / NAME).write_bytes(whole[:length])
        again = opened(cut)
        (first, *_) = items = taken(again)
        assert first.first == 129
        position = again.facts.position
        assert position
        assert items[-1].last == position.sequence
        assert position.sequence in (192, 300)
        again.close()
        shutil.rmtree(cut)


def test_a_wal_that_was_cut_is_no_loss(tmp_path: Path) -> None:
    made = tmp_path / "made"
    database = opened(made)
    for number in range(1, 101):
        add(database, event(number))
        if number % 10 == 0:
            database.delivered(sent(database), repeated=False)
    last = sent(database) if database.next_batch() else None
    assert last is None
    shutil.copytree(made, tmp_path / "copy")  # Closed, it would have no WAL.
    database.close()
    wal = (tmp_path / "copy" / f"{NAME}-wal").read_bytes()
    for length in [0, 31, 32, *random.sample(range(len(wal)), 20)]:
        cut = tmp_path / "cut"
        shutil.copytree(tmp_path / "copy", cut)
        (cut / f"{NAME}-wal").write_bytes(wal[:length])
        again = opened(cut)
        batch = again.next_batch()
        assert batch is None or (batch.first, batch.last) == (91, 100), "what the hub refuses"
        items = taken(again)
        assert not items or (items[0].first, items[-1].last) == (91, 100)
        assert again.facts.position == Position(RUN, 100)
        again.close()
        shutil.rmtree(cut)


def pragmas(database: Database) -> dict[str, object]:
    """How SQLite itself says that it treats the disk."""
    database.open()
    assert database._connection
    names = ("journal_mode", "synchronous", "locking_mode", "wal_autocheckpoint", "page_size")
    return {name: database._connection.execute(f"PRAGMA {name}").fetchone()[0] for name in names}


@pytest.mark.parametrize("before", ["nothing", "its own", "a damaged one", "one with another journal"])
def test_what_was_taken_is_on_the_disk_however_it_was_opened(tmp_path: Path, before: str) -> None:
    """WAL alone is synced at checkpoints: only with synchronous = FULL a commit survives a power cut."""
    path = tmp_path / NAME
    if before == "a damaged one":
        path.write_bytes(b"something else" * 1000)
    elif before != "nothing":
        first = opened(tmp_path)
        add(first, event(1))
        first.close()
    if before == "one with another journal":
        with closing(sqlite3.connect(path)) as db:
            assert db.execute("PRAGMA journal_mode = DELETE").fetchone() == ("delete",)
    full = 2  # sqlite.org/pragma.html#pragma_synchronous
    with closing(opened(tmp_path)) as database:
        assert pragmas(database) == {
            "journal_mode": "wal",
            "synchronous": full,
            "locking_mode": "exclusive",
            "wal_autocheckpoint": 256,
            "page_size": 4096,
        }


def test_bytes_of_others_are_moved_aside(tmp_path: Path) -> None:
    (tmp_path / NAME).write_bytes(b"something else" * 1000)
    database = opened(tmp_path)
    assert database.next_batch() is None
    assert (tmp_path / DAMAGED_NAME).read_bytes().startswith(b"something else")
    database.close()


def test_a_newer_version_is_not_touched(tmp_path: Path) -> None:
    database = opened(tmp_path)
    add(database, event(1))
    assert database._connection
    database._connection.execute("PRAGMA user_version = 99")
    database.close()
    again = opened(tmp_path)
    with pytest.raises(OutboxError, match="newer robot-bridge"):
        again.open()
    assert not (tmp_path / DAMAGED_NAME).exists()


def test_a_second_bridge_is_refused(tmp_path: Path, database: Database) -> None:
    add(database, event(1))
    with pytest.raises(OutboxError, match="another robot-bridge"):
        opened(tmp_path).open()
    add(database, event(2))
    assert len(taken(database)) == 2


def test_a_folder_that_cannot_be_made_is_an_error_with_words(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(OutboxError, match="file"):
        opened(tmp_path / "file" / "outbox").open()


def test_a_command_is_begun_once_and_has_one_result(database: Database) -> None:
    assert database.begin_command("a1")
    assert not database.begin_command("a1")
    assert database.unanswered_commands() == ["a1"]
    database.end_command("a1", b"done")
    database.end_command("a1", b"done differently")
    database.end_command("b2", b"refused")
    assert database.unanswered_commands() == []
    assert database.next_result() == ("a1", b"done")
    database.result_sent("a1")
    assert database.next_result() == ("b2", b"refused")
    database.result_sent("b2")
    assert database.next_result() is None
    assert not database.begin_command("a1")


@pytest.mark.parametrize("taken_by_the_hub", [False, True])
def test_only_the_newest_commands_are_remembered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, taken_by_the_hub: bool
) -> None:
    monkeypatch.setattr(commands, "MOST_COMMANDS", 16)
    database = opened(tmp_path)
    assert database.begin_command("running")
    for number in range(100):
        database.end_command(f"c{number}", b"refused")
        if taken_by_the_hub:
            database.result_sent(f"c{number}")
    assert database.unanswered_commands() == ["running"]
    assert not any(database.begin_command(f"c{number}") for number in range(84, 100))
    waiting = []
    while result := database.next_result():
        waiting.append(result[0])
        database.result_sent(result[0])
    assert waiting == ([] if taken_by_the_hub else [f"c{number}" for number in range(84, 100)])
    database.close()
    with closing(sqlite3.connect(tmp_path / NAME)) as db:
        assert db.execute("SELECT count(*) FROM commands").fetchone() == (17,)


def test_rows_of_uploads_are_kept(tmp_path: Path) -> None:
    database = opened(tmp_path)
    database.put_upload("r1", "one")
    database.put_upload("r2", "two")
    database.put_upload("r1", "three")
    database.delete_uploads(["r2"])
    database.close()
    again = opened(tmp_path)
    assert again.uploads() == ["three"]
    again.close()


def test_what_kills_amid_a_new_cursor_have_left_is_removed(tmp_path: Path) -> None:
    """The defect: each left a file of its own, for ever, beside what the outbox may take."""
    first = opened(tmp_path)
    add(first, event(1))
    sent(first)
    first.close()
    left = tmp_path / f".{CURSOR}.k1ll3d"
    left.write_text("{")
    other = tmp_path / ".other"
    other.touch()
    again = opened(tmp_path)
    assert sent(again).first == 1
    again.close()
    assert not left.exists()
    assert other.exists()


def test_what_the_disk_has_refused_is_no_fact(tmp_path: Path, database: Database) -> None:
    """The defect: while the disk was full, the status showed an event as taken that was not."""
    add(database, event(1))
    before = database.facts
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, ((tmp_path / f"{NAME}-wal").stat().st_size, limits[1]))
    try:
        with pytest.raises(OutboxError):
            add(database, event(2, size=60_000))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert database.facts == before
    assert taken(database) == [event(1)]


def change(directory: Path, what: str) -> None:
    """Does what a bad disk can: a row of a database that is whole is another one."""
    with closing(sqlite3.connect(directory / NAME)) as changed:
        assert changed.execute(f"UPDATE {what}").rowcount == 1
        changed.commit()


@pytest.mark.parametrize("what", ["reason = 99", "last = 'x'", "last = -7", "earlier = 'x'"])
def test_gaps_that_no_bridge_writes_are_damage(tmp_path: Path, what: str) -> None:
    """The defect: a bridge ended at one, or tried to send it for ever, and again after each start."""
    first = opened(tmp_path)
    add(first, event(1), Gap(RUN, 2, 2, DropReason.DISK))
    first.close()
    change(tmp_path, f"items SET {what} WHERE first = 2")
    again = opened(tmp_path)
    assert again.is_new()
    assert taken(again) == []
    again.close()
    assert (tmp_path / DAMAGED_NAME).exists()


@pytest.mark.parametrize("what", ["reason = 64", "last = 'x'", "last = 7", "earlier = 'x'", "probes = 1.5"])
def test_what_says_nothing_in_an_events_row_costs_nothing(tmp_path: Path, what: str) -> None:
    """The defect: the outbox was moved aside, with all events that had not been sent."""
    first = opened(tmp_path)
    add(first, event(1), event(2), event(3))
    first.close()
    change(tmp_path, f"items SET {what} WHERE first = 2")
    again = opened(tmp_path)
    assert taken(again) == [event(1), event(2), event(3)]
    again.close()
    assert not (tmp_path / DAMAGED_NAME).exists()


@pytest.mark.parametrize("what", ["reason = 64", "last = 7", "earlier = 1", "severity = 'x'"])
def test_nor_does_it_in_the_gap_that_takes_the_events_place(tmp_path: Path, what: str) -> None:
    first = opened(tmp_path)
    add(first, event(1), event(2), event(3))
    first.close()
    change(tmp_path, f"items SET {what} WHERE first = 2")
    again = opened(tmp_path)
    while again.drop_oldest():
        pass
    (gap,) = taken(again)
    assert (gap.run_id, gap.first, gap.last) == (RUN, 1, 3)
    assert isinstance(gap, Gap)
    assert not gap.earlier
    again.close()


@pytest.mark.parametrize(
    "what", ["payload = 7", "payload = 7, last = 'x', reason = 99, earlier = 'x', probes = 'x'"]
)
def test_an_event_that_is_no_bytes_becomes_a_gap(tmp_path: Path, what: str) -> None:
    first = opened(tmp_path)
    add(first, event(1), event(2), event(3))
    first.close()
    change(tmp_path, f"items SET {what} WHERE first = 2")
    again = opened(tmp_path)
    assert taken(again) == [event(1), Gap(RUN, 2, 2, DropReason.OUTBOX_LOST, worst=1), event(3)]
    assert (again.facts.sent, again.facts.dropped) == (2, 1)
    again.close()


@pytest.mark.parametrize(
    "what",
    [
        "items SET run_id = 'run 1' WHERE id = 1",
        "items SET first = 'x' WHERE id = 2",
        "items SET run_id = 'run-3' WHERE id = 3",
        "meta SET value = 5 WHERE key = 'sequence'",
        "meta SET value = 'run-3' WHERE key = 'run_id'",
    ],
)
def test_a_row_without_sense_or_a_place_beside_the_position_is_damage(tmp_path: Path, what: str) -> None:
    with closing(opened(tmp_path)) as first:
        add(first, event(1), event(2), event(3))
    change(tmp_path, what)
    with closing(opened(tmp_path)) as again:
        assert again.is_new()
        assert taken(again) == []
    assert (tmp_path / DAMAGED_NAME).exists()


@pytest.mark.parametrize(
    "what",
    [
        "key = 'sequencd' WHERE key = 'sequence'",
        "key = 'run_ie' WHERE key = 'run_id'",
        "value = 'x' WHERE key = 'sequence'",
        "value = -1 WHERE key = 'sequence'",
        "value = 2 WHERE key = 'sequence'",
        "value = 67 WHERE key = 'sequence'",
        "value = 7 WHERE key = 'run_id'",
        "value = CAST(x'ff' AS TEXT) WHERE key = 'run_id'",
    ],
)
def test_a_position_that_is_none_or_another_is_damage(tmp_path: Path, what: str) -> None:
    """The defect: the bridge ended at it, and again at each start; or events were lost without a gap."""
    with closing(opened(tmp_path)) as first:
        add(first, event(1), event(2), event(3))
        first.delivered(sent(first), repeated=False)
    change(tmp_path, f"meta SET {what}")
    with closing(opened(tmp_path)) as again:
        again.open()
        assert again.facts.position == Position(RUN, 3), "which the cursor has"
        assert again.is_new()
    assert (tmp_path / DAMAGED_NAME).exists()


@pytest.mark.parametrize("key", ["events", "sent", "dropped"])
@pytest.mark.parametrize("value", ["'x'", "x'ff'", "CAST(x'ff' AS TEXT)", "-1", "9223372036854775807", "0.5"])
def test_a_count_that_is_none_begins_anew(tmp_path: Path, key: str, value: str) -> None:
    """The defect: the bridge ended at it, and again at each start."""
    with closing(opened(tmp_path)) as first:
        add(first, event(1), event(2), event(3))
        assert first.drop_oldest()
        first.delivered(sent(first), repeated=False)
        add(first, event(4))
    change(tmp_path, f"meta SET value = {value} WHERE key = '{key}'")
    with closing(opened(tmp_path)) as again:
        again.open()
        facts = again.facts
        assert {"events": 1, "sent": 2, "dropped": 1} | ({} if key == "events" else {key: 0}) == {
            "events": facts.events,
            "sent": facts.sent,
            "dropped": facts.dropped,
        }
        assert taken(again) == [event(4)]


@pytest.mark.parametrize(
    "what", ["result = 'done'", "result = 7", "command_id = 'a b'", "command_id = CAST(x'ff' AS TEXT)"]
)
def test_a_command_that_no_bridge_writes_has_no_result(tmp_path: Path, what: str) -> None:
    """The defect: the bridge ended at it, and again at each start; or it sent the result for ever."""
    with closing(opened(tmp_path)) as first:
        first.end_command("a1", b"done")
        first.end_command("b2", b"done")
    change(tmp_path, f"commands SET {what} WHERE command_id = 'a1'")
    with closing(opened(tmp_path)) as again:
        assert again.next_result() == ("b2", b"done")
        again.result_sent("b2")
        assert again.next_result() is None
        assert again.unanswered_commands() == []
    assert not (tmp_path / DAMAGED_NAME).exists()


@pytest.mark.parametrize("what", ["result = 'done'", "command_id = 'a b'"])
def test_a_command_that_the_disk_has_changed_is_reported_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, what: str
) -> None:
    """The defect: at each start, and after each error of the outbox."""
    with closing(opened(tmp_path)) as first:
        first.end_command("a1", b"done")
    change(tmp_path, f"commands SET {what} WHERE command_id = 'a1'")
    for _ in range(3):
        with closing(opened(tmp_path)) as again:
            again.open()
    assert [each.getMessage() for each in caplog.records] == [
        "commands that the disk has changed get no result: 1"
    ]


def test_the_rows_of_a_whole_outbox_are_scanned_once_as_it_is_opened(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Besides SQLite's own check. The defect: five times, and the gateway waits until it is open."""
    with closing(opened(tmp_path)) as first:
        add(first, event(1), event(2), Gap(RUN, 3, 3, DropReason.DISK))
    connect, statements = Database._connect, list[str]()

    def traced(self: Database) -> sqlite3.Connection:
        db = connect(self)
        db.set_trace_callback(statements.append)
        return db

    monkeypatch.setattr(Database, "_connect", traced)
    with closing(opened(tmp_path)) as again:
        again.open()
    with closing(sqlite3.connect(tmp_path / NAME)) as db:
        scans = [
            each
            for each in statements
            if each.lstrip().startswith(("SELECT", "UPDATE", "DELETE")) and "LIMIT" not in each
            for row in db.execute(f"EXPLAIN QUERY PLAN {each}")
            if row[3].startswith("SCAN items")
        ]
    assert len(scans) == 1, scans


def test_an_uploads_row_that_is_no_utf_8_is_read(tmp_path: Path) -> None:
    """It is judged by its reader. The defect: an error of the outbox, at each start."""
    with closing(opened(tmp_path)) as first:
        first.put_upload("r1", "one")
    change(tmp_path, "uploads SET row = CAST(x'6fff65' AS TEXT)")
    with closing(opened(tmp_path)) as again:
        assert again.uploads() == ["o\ufffde"]
