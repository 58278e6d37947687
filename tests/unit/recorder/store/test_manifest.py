"""Manifests: what they keep, and what is no manifest."""

from dataclasses import replace
from pathlib import Path

import pytest

from recorder.store.folder import segment_name
from recorder.store.gaps import MAX_GAPS, bounded
from recorder.store.manifest import DamagedManifestError, Kind, Manifest, RecordingState, read_manifest
from recorder.values import VIDEO_TOPIC, ChannelSummary, Gap, GapCause, Losses, SegmentSummary

ID = "20260101T000000Z-abcdef"
SEGMENT = {"name": "data/000000.mcap", "size": 1, "sha256": "0" * 64}


def manifest(**values: object) -> Manifest:
    return Manifest.model_validate(
        {"id": ID, "kind": Kind.MANUAL, "state": RecordingState.COMPLETE, **values}
    )


def summary(messages: int = 3, gaps: tuple[Gap, ...] = ()) -> SegmentSummary:
    channels = (
        ChannelSummary("/odom", "nav_msgs/msg/Odometry", "", messages),
        ChannelSummary(VIDEO_TOPIC, "foxglove_msgs/msg/CompressedVideo", "", 2),
    )
    return SegmentSummary(Path("x"), 100, "0" * 64, messages + 2, channels, 5, 9_000_000, gaps)


def gap(at_ns: int, messages: int | None = 1, cause: GapCause = GapCause.MIDDLEWARE) -> Gap:
    return Gap("/odom", cause, at_ns, at_ns, messages)


def test_it_is_read_as_it_was_written(tmp_path: Path) -> None:
    folder = tmp_path / ID
    folder.mkdir()
    made = manifest(label="a", pinned=True).with_segment("data/000000.mcap", summary(gaps=(gap(1),)))
    made.write(folder)
    assert read_manifest(folder) == made
    assert made.summaries(folder)[0].channels == summary().channels


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"{",
        b"[]",
        b'{"id": "../../etc"}',
        b"\xff\xfe",
        manifest(id="20260101T000000Z-000000").model_dump_json().encode(),
        manifest(segments=[SEGMENT]).model_dump_json().replace("data/", "../../").encode(),
    ],
)
def test_what_is_no_manifest_of_this_recording_is_damaged(tmp_path: Path, content: bytes) -> None:
    folder = tmp_path / ID
    folder.mkdir()
    (folder / "manifest.json").write_bytes(content)
    with pytest.raises(DamagedManifestError):
        read_manifest(folder)


def test_counts_add_up_and_topics_are_named_once() -> None:
    made = manifest()
    for number in range(3):
        made = made.with_segment(f"data/{number:06d}.mcap", summary(messages=number))
    made = made.with_segment("data/000002.mcap", summary(messages=10))  # In place of the former one.
    assert (made.messages, made.video_frames, len(made.topics)) == (0 + 1 + 10 + 6, 6, 2)
    assert made.next_number == 3
    assert made.before(1).messages == 2
    assert made.spanning().ended_unix_ms == 9


def test_the_millionth_segment_follows_the_one_before(tmp_path: Path) -> None:
    made = manifest()
    for number in (1_000_000, 999_999):
        made = made.with_segment(segment_name(number), summary())
    assert [each.name for each in made.segments] == ["data/999999.mcap", "data/1000000.mcap"]
    assert made.next_number == 1_000_001
    folder = tmp_path / ID
    folder.mkdir()
    made.write(folder)
    assert read_manifest(folder) == made


def test_gaps_of_unknown_size_are_counted_and_never_read_as_nothing_lost() -> None:
    known = [gap(1, 2), gap(2, 3)]
    assert manifest(gaps=known).losses == Losses(messages=5)
    cut = gap(3, None, GapCause.INTERRUPTED)
    found = manifest(gaps=[*known, cut, gap(4, None, GapCause.VIDEO)]).losses
    assert (found.counted, found.uncounted) == (5, 1)
    assert manifest(gaps=[cut]).losses.counted is None, "not 0"
    assert manifest(numbered=False).losses.counted is None
    assert manifest().losses.counted == 0


def stop(began_ns: int, ended_ns: int, cause: GapCause = GapCause.INTERRUPTED) -> Gap:
    return Gap("", cause, began_ns, ended_ns, None)


def test_two_interruptions_of_which_one_follows_the_other_are_two() -> None:
    """The defect: the one of the file vanished, because the other begins where it ends."""
    refused, cut = stop(20, 30, GapCause.DISK), stop(30, 30)
    found = manifest(gaps=[cut]).with_segment("data/000000.mcap", summary(gaps=(refused,)))
    assert found.all_gaps == (refused, cut)
    assert found.losses.uncounted == 2


@pytest.mark.parametrize(
    ("known", "in_file"),
    [
        (stop(30, 30), stop(30, 40)),
        (stop(20, 30), stop(20, 30, GapCause.DISK)),
    ],
    ids=["longer in the file", "a hole of the ring, of which the next file alone knows the cause"],
)
def test_an_interruption_that_file_and_manifest_have_is_one(known: Gap, in_file: Gap) -> None:
    found = manifest(gaps=[known]).with_segment("data/000000.mcap", summary(gaps=(in_file,)))
    assert found.all_gaps == (known,)


def test_of_an_interruption_a_snapshot_has_what_lies_in_its_window() -> None:
    """The defect: a night without the ring was shown whole if its first message came within the window."""
    made = manifest(kind=Kind.SNAPSHOT, window_ns=(20, 50))
    before, during, lost = stop(1, 19), stop(5, 40), gap(7)
    made = made.with_segment("data/000000.mcap", summary(gaps=(before, during, lost)))
    assert made.all_gaps == (lost, stop(20, 40))


def test_an_interruption_after_the_clock_was_set_forward_is_in_the_snapshot() -> None:
    """The defect: it was hidden, as what comes after the end of the window."""
    made = manifest(kind=Kind.SNAPSHOT, window_ns=(20, 50))
    gaps = (stop(40, 1000), stop(1005, 1010), stop(1020, 1020))
    assert made.with_segment("data/000000.mcap", summary(gaps=gaps)).all_gaps == gaps


def test_gaps_beyond_the_bound_are_counted_one_by_one() -> None:
    gaps = [*(gap(at) for at in range(MAX_GAPS)), *(gap(at + MAX_GAPS, None) for at in range(7))]
    made = manifest(gaps=gaps)
    assert len(made.all_gaps) == MAX_GAPS
    assert (made.losses.counted, made.losses.uncounted) == (MAX_GAPS, 7)


def test_one_file_without_numbers_makes_the_count_unknown(tmp_path: Path) -> None:
    unnumbered = replace(summary(), numbered=False)
    made = manifest().with_segment("data/000000.mcap", summary())
    made = made.with_segment("data/000001.mcap", unnumbered)
    assert made.losses.counted is None
    folder = tmp_path / ID
    folder.mkdir()
    made.write(folder)
    assert read_manifest(folder).losses.counted is None
    assert made.summaries(folder)[1].numbered is False


def test_a_file_that_can_t_be_read_is_a_gap_between_its_neighbours() -> None:
    made = manifest()
    for number in (0, 2):
        times = replace(summary(), first_ns=number * 10, last_ns=number * 10 + 5)
        made = made.with_segment(f"data/{number:06d}.mcap", times)
    found = made.without_segment("data/000001.mcap")
    assert found.gaps == (Gap("", GapCause.DISK, 5, 20, None),)
    assert found.without_segment("data/000001.mcap") == found, "once"
    last = made.without_segment("data/000003.mcap")
    assert last.gaps == (Gap("", GapCause.DISK, 25, 25, None),)
    goes_on = last.with_segment("data/000004.mcap", replace(summary(), first_ns=40, last_ns=45))
    again = goes_on.without_segment("data/000003.mcap")
    assert again.gaps == (Gap("", GapCause.DISK, 25, 40, None),), "the same one, longer"


def test_gaps_beyond_the_bound_become_one() -> None:
    kept = bounded([gap(at) for at in range(MAX_GAPS + 500)])
    assert len(kept) == MAX_GAPS
    assert sum(each.messages or 0 for each in kept) == MAX_GAPS + 500
    assert kept[-1].ended_ns == MAX_GAPS + 499


def test_the_sum_changes_with_the_files_and_with_nothing_else() -> None:
    made = manifest().with_segment("data/000000.mcap", summary())
    assert made.sha256 == made.model_copy(update={"pinned": True, "label": "b"}).sha256
    assert made.sha256 != made.with_segment("data/000001.mcap", summary()).sha256
    assert made.model_copy(update={"state": RecordingState.RECORDING}).sha256 == b""
