"""Which messages a segment's head repeats."""

from dataclasses import replace

import pytest

from recorder.intake import latched
from recorder.intake.latched import MAX_MESSAGES, LatchedCache
from recorder.values import Channel, Sample
from tests.support.segments import STRING, string_sample

MAP = replace(STRING, topic="/map", latched=True)
TF = replace(STRING, topic="/tf_static", latched=True)


def sample(number: int, text: str, channel: Channel = TF, publishers: int = 1) -> Sample:
    return replace(string_sample(number, text), channel=channel, sequence=number, publishers=publishers)


def kept(*samples: Sample) -> list[Sample]:
    cache = LatchedCache()
    for each in samples:
        cache.take(each)
    return list(cache.samples())


def test_of_one_publisher_the_newest_stays() -> None:
    newest = sample(3, "c")
    assert kept(sample(1, "a"), sample(2, "b"), newest) == [newest]


def test_of_several_publishers_the_newest_of_each_stays() -> None:
    base, arm, lidar = sample(1, "base"), sample(1, "arm"), sample(1, "lidar")
    assert kept(base, arm, lidar) == [base, arm, lidar]


def test_a_publisher_that_repeats_itself_drives_out_no_other() -> None:
    base, arm = sample(1, "base"), sample(1, "arm")
    repeated = [sample(number, "base") for number in range(2, 200)]
    assert kept(base, arm, *repeated) == [arm, repeated[-1]]


def test_one_that_changes_replaces_its_own() -> None:
    arm, newest = sample(1, "arm", publishers=2), sample(9, "c", publishers=2)
    assert kept(sample(7, "a", publishers=2), arm, sample(8, "b", publishers=2), newest) == [arm, newest]


@pytest.mark.parametrize("numbers", [(1, 3), (3, 1), (1, 2), (2, 1), (0, 0)])
def test_one_of_two_publishers_never_replaces_the_only_message_of_the_other(
    numbers: tuple[int, int],
) -> None:
    """The defect: what had come first was missing from every later file if its number was lower."""
    first, second = (sample(each, f"by {at}", publishers=2) for at, each in enumerate(numbers))
    assert kept(first, second) == [first, second]


def test_a_third_publisher_replaces_neither_of_the_others() -> None:
    base, arm = sample(1, "base", publishers=2), sample(5, "arm", publishers=2)
    lidar = sample(2, "lidar", publishers=3)
    assert kept(base, arm, lidar) == [base, arm, lidar]
    assert kept(base, arm, replace(lidar, publishers=2)) == [arm, replace(lidar, publishers=2)]


def test_of_an_unknown_number_of_publishers_all_stay() -> None:
    one, other = sample(1, "a", publishers=0), sample(2, "b", publishers=0)
    assert kept(one, other) == [one, other]


def test_channels_are_kept_apart() -> None:
    one, other = sample(1, "a", MAP), sample(2, "b", TF)
    assert kept(one, other) == [one, other]


def test_a_flood_of_publishers_is_bounded() -> None:
    assert len(kept(*(sample(1, f"{number}") for number in range(1000)))) == MAX_MESSAGES


def test_bytes_are_bounded_but_each_channel_keeps_its_newest(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(latched, "MAX_BYTES", 3000)
    maps = [sample(1, f"{number}" * 500, MAP) for number in range(9)]
    tf = sample(1, "small")
    found = kept(tf, *maps)
    assert found[0] == tf
    assert found[-1] == maps[-1]
    assert sum(len(each.data) for each in found) <= 3000
    huge = sample(1, "x" * 10_000, MAP)
    assert kept(tf, huge) == [tf, huge]


def test_without_numbers_the_only_one_is_replaced() -> None:
    assert kept(sample(0, "a"), sample(0, "b")) == [sample(0, "b")]


def test_what_is_forgotten_takes_no_room(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(latched, "MAX_BYTES", 3000)
    cache = LatchedCache()
    tf = [sample(1, "a" * 900), sample(1, "b" * 900)]
    for each in (sample(1, "x" * 900, MAP), *tf):
        cache.take(each)
    cache.forget(MAP)
    cache.forget(MAP)
    more = sample(1, "c" * 900)
    cache.take(more)
    assert list(cache.samples()) == [*tf, more]


def test_lines_of_the_log_are_no_state_that_holds() -> None:
    assert kept(sample(1, "started", replace(TF, topic="/rosout"))) == []
