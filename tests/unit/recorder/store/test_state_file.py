"""Answers that outlive a restart."""

from pathlib import Path

import pytest

from common.errors import InvalidRequestError
from recorder.store.state_file import REMEMBERED_S, Answer, StateFile


def answer(at_s: float = 1000.0) -> Answer:
    return Answer(method="StartRecording", recording_id="a", message="done", at_s=at_s)


def test_an_answer_is_given_again_for_ten_minutes_after_a_restart_too(tmp_path: Path) -> None:
    before = StateFile(tmp_path)
    before.remember("1", answer())
    before.measure("driving", 1_000_000, with_video=True)
    before.measure("driving", 7000, with_video=False)
    before.write()
    after = StateFile(tmp_path)
    after.load()
    assert after.answered("StartRecording", "1", 1000.0 + REMEMBERED_S - 1) == answer()
    assert after.answered("StartRecording", "1", 1000.0 + REMEMBERED_S) is None
    assert after.answered("StartRecording", "2", 1000.0) is None
    assert after.bytes_per_minute("driving", with_video=True) == 1_000_000
    assert after.bytes_per_minute("driving", with_video=False) == 7000
    assert after.bytes_per_minute("everything", with_video=False) == 0


def test_the_file_of_a_former_release_is_read(tmp_path: Path) -> None:
    """What it had measured stands for both, with video and without, until that is measured."""
    made = f'"1": {answer().model_dump_json()}'
    (tmp_path / "state.json").write_text(f'{{"answers": {{{made}}}, "bytes_per_minute": {{"driving": 5}}}}')
    state = StateFile(tmp_path)
    state.load()
    assert state.answered("StartRecording", "1", 1000.0) == answer()
    state.measure("driving", 7, with_video=True)
    state.write()
    state = StateFile(tmp_path)
    state.load()
    assert state.bytes_per_minute("driving", with_video=True) == 7
    assert state.bytes_per_minute("driving", with_video=False) == 5


def test_an_id_stands_for_one_method() -> None:
    state = StateFile(Path())
    state.remember("1", answer())
    with pytest.raises(InvalidRequestError, match="was used for StartRecording"):
        state.answered("StopRecording", "1", 1000.0)


@pytest.mark.parametrize("content", [b"", b"{", b'{"answers": 7}'])
def test_a_damaged_file_counts_as_empty(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "state.json").write_bytes(content)
    state = StateFile(tmp_path)
    state.load()
    assert state.answered("StartRecording", "1", 0.0) is None


def test_an_answer_of_an_earlier_boot_is_given_while_this_boot_is_young(tmp_path: Path) -> None:
    """Whatever the calendar says: a robot may have no clock of its own."""
    before = StateFile(tmp_path, "first")
    made = answer(1_800_000_000.0).model_copy(update={"boot_id": "first"})
    before.remember("1", made)
    before.write()
    after = StateFile(tmp_path, "second")
    after.load()
    assert after.answered("StartRecording", "1", REMEMBERED_S - 1) == made
    assert after.answered("StartRecording", "1", REMEMBERED_S) is None
    after.remember("2", answer(REMEMBERED_S).model_copy(update={"boot_id": "second"}))
    assert after.answered("StartRecording", "1", 0.0) is None, "it is forgotten"
