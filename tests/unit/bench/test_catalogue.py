"""The catalogue of all rows: what words choose of it, and that it names modules that exist."""

from pathlib import Path

import pytest

from bench import catalogue
from bench.catalogue import GROUPS, NAMES, ON_REQUEST, PARTS, chosen

ROOT = Path(catalogue.__file__).parent.parent


def test_every_row_is_in_it_once() -> None:
    assert len(set(NAMES)) == len(NAMES)


@pytest.mark.parametrize("part", PARTS, ids=lambda part: part.names[0])
def test_a_part_is_of_one_group_and_its_module_exists(part: catalogue.Part) -> None:
    assert {name.partition(".")[0] for name in part.names} == {part.group}
    assert part.module == f"bench.{part.group}" or part.module.startswith(f"bench.{part.group}.")
    file = ROOT / part.module.replace(".", "/")
    assert file.with_suffix(".py").exists() or (file / "__init__.py").exists()


def test_without_words_all_but_what_is_on_request_is_chosen() -> None:
    assert {part.group for part in chosen(())} == set(GROUPS) - set(ON_REQUEST)


def test_words_choose_groups_and_rows_in_the_order_of_the_catalogue() -> None:
    plan = chosen(("soak.fds_growth", "status", "ros.flat"))
    assert [name for names in plan.values() for name in names] == [
        "ros.flat",
        *(name for name in NAMES if name.startswith("status.")),
        "soak.fds_growth",
    ]


@pytest.mark.parametrize(
    ("word", "said"),
    [
        ("video.excess_latency_20", "rows are video.excess_reference"),
        ("status.typo", "rows are status.throughput"),
        ("vidio", "groups are ros, status"),
    ],
)
def test_an_unknown_word_is_refused_with_the_nearest_known_ones(word: str, said: str) -> None:
    with pytest.raises(ValueError, match=f"'{word}': {said}"):
        chosen((word,))
