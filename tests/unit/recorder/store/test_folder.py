"""Names of files in a recording's folder."""

from pathlib import Path

from recorder.store.catalogue import first_free_number, segments_in
from recorder.store.folder import DATA, segment_name


def test_segments_are_found_by_number_beyond_the_millionth(tmp_path: Path) -> None:
    (tmp_path / DATA).mkdir()
    for number in (1_000_000, 999_999, 7):
        (tmp_path / segment_name(number)).touch()
    for unknown in ("0000008.mcap", "12345.mcap", "1000001.mcap.part", "000009.mcap.damaged"):
        (tmp_path / DATA / unknown).touch()
    assert [path.name for path in segments_in(tmp_path)] == ["000007.mcap", "999999.mcap", "1000000.mcap"]
    assert first_free_number(tmp_path) == 1_000_002
