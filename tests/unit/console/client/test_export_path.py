"""Where files of a robot are written, whatever it calls them."""

from pathlib import Path

import pytest

from console.client.errors import GatewayFailed
from console.client.export_path import path_below


@pytest.mark.parametrize(
    "name",
    [
        "",
        "/",
        "/etc/passwd",
        "../out",
        "a/../../out",
        "a//b",
        ".",
        "a/.",
        "a\0b",
        "a\nb",
        "a\x1b[2Jb",
        "a\u202eb",
        "C:out",
        "a\\b",
        "CON",
        "nul.mcap",
        "data/Com1.tar.gz",
        "a.",
        "a ",
        "-rf",
        "~root",
        "a" * 251,
        "/".join("a" * 17),
    ],
)
def test_these_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(GatewayFailed, match="unusable name"):
        path_below(tmp_path, name)


@pytest.mark.parametrize("name", ["data/000000.mcap", "metadata.yaml", ".hidden", "a b/ä (1).txt", "a" * 250])
def test_these_stay_below_the_folder(tmp_path: Path, name: str) -> None:
    path = path_below(tmp_path, name)
    assert path == tmp_path / name
    assert path.resolve().is_relative_to(tmp_path.resolve())


def test_a_link_in_the_folder_leads_nowhere_else(tmp_path: Path) -> None:
    (tmp_path / "to").mkdir()
    (tmp_path / "to/data").symlink_to(tmp_path)
    with pytest.raises(GatewayFailed, match="leads out of"):
        path_below(tmp_path / "to", "data/a")
