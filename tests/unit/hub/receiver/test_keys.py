"""Names of robots become keys below their recording, or are refused."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hub.receiver.keys import BadNameError, RecordingKeys

KEYS = RecordingKeys("lab", "r1", "20261122-one_a")


def test_a_file_its_receipt_and_the_recording_have_places_of_their_own() -> None:
    assert KEYS.file("data/000000.mcap") == "lab/r1/20261122-one_a/data/000000.mcap"
    assert KEYS.receipt("data/000000.mcap") == "lab/r1/20261122-one_a.receipts/data/000000.mcap"
    assert KEYS.recording == "lab/r1/20261122-one_a.recording"


@pytest.mark.parametrize(
    "name",
    [
        "",
        ".",
        "..",
        "../other/data.mcap",
        "data/../../r2/x",
        "/etc/passwd",
        "data//x",
        "data/",
        "a\\b",
        "a\0b",
        "a\nb",
        "a\x1bb",
        "data/. /x",
        "data./x",
        "a\u202eb",
        "a\u2028b",
        "a\u200bb",
        "C:x",
        "x" * 256,
        "ä" * 128,
        "/".join("x" * 20),
    ],
)
def test_hostile_names_of_files_are_refused(name: str) -> None:
    for place in (KEYS.file, KEYS.receipt):
        with pytest.raises(BadNameError):
            place(name)


@pytest.mark.parametrize("recording_id", ["", "..", "a/b", "a.receipts", "a.recording", "x" * 65, "é", "a\n"])
def test_hostile_ids_are_refused(recording_id: str) -> None:
    with pytest.raises(BadNameError):
        RecordingKeys("lab", "r1", recording_id)


@given(st.text(max_size=80), st.text(max_size=80))
def test_no_name_leads_out_of_its_recording_or_to_a_receipt(recording_id: str, name: str) -> None:
    try:
        keys = RecordingKeys("lab", "r1", recording_id)
        file, receipt = keys.file(name), keys.receipt(name)
    except BadNameError:
        return
    assert file.startswith(f"lab/r1/{recording_id}/")
    assert ".receipts/" not in file.removeprefix("lab/r1/").partition("/")[0] + "/"
    assert receipt.startswith(f"lab/r1/{recording_id}.receipts/")
    assert not {"", ".", ".."}.intersection(file.split("/"))
