"""docker/packages: what it takes out of a system so that the same packages are the same files."""

import subprocess
from pathlib import Path

from tests.support.engine import ROOT

GONE = (
    "var/lib/apt/lists/index",
    "var/cache/apt/archives/python3.deb",
    "var/cache/fontconfig/d589a488-le64.cache-8",
    "var/cache/ldconfig/aux-cache",
    "var/cache/debconf/config.dat-old",
    "var/lib/dpkg/status-old",
    "var/lib/dbus/machine-id",
    "var/log/apt/term.log",
    "var/log/dpkg.log",
    "etc/passwd-",
    "etc/shadow-",
)
KEPT = (
    "var/cache/debconf/config.dat",
    "var/lib/dpkg/status",
    "var/lib/apt/extended_states",
    "var/log/lastlog",
    "etc/passwd",
    "etc/ld.so.cache",
)


def packages(*words: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [ROOT / "docker/packages", *words], capture_output=True, text=True, timeout=30, check=False
    )


def test_what_differs_between_installations_is_taken_out_and_nothing_else(tmp_path: Path) -> None:
    for name in (*GONE, *KEPT):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(name)
    (tmp_path / "etc/machine-id").write_text("e0f0b0\n")
    shadow = tmp_path / "etc/shadow"
    shadow.write_text("root:*:20784:0:99999:7:::\nmessagebus:!:20785::::::\nrobot:$y$j9T$a:20785:0:::::\n")
    shadow.chmod(0o640)
    ended = packages("clean", tmp_path)
    assert (ended.returncode, ended.stderr) == (0, "")
    assert [name for name in GONE if (tmp_path / name).exists()] == []
    assert {name: (tmp_path / name).read_text() for name in KEPT} == {name: name for name in KEPT}
    assert (tmp_path / "etc/machine-id").read_text() == ""
    assert shadow.read_text() == "root:*::0:99999:7:::\nmessagebus:!:::::::\nrobot:$y$j9T$a::0:::::\n"
    assert shadow.stat().st_mode & 0o777 == 0o640


def test_a_system_that_has_none_of_it_is_clean(tmp_path: Path) -> None:
    (tmp_path / "etc").mkdir()
    (tmp_path / "etc/shadow").write_text("root:*:::::::\n")
    assert packages("clean", tmp_path).returncode == 0
    assert not (tmp_path / "etc/machine-id").exists()


def test_a_directory_that_is_missing_is_named(tmp_path: Path) -> None:
    ended = packages("clean", tmp_path / "missing")
    assert ended.returncode == 1
    assert f"there is no directory '{tmp_path}/missing'" in ended.stderr


def test_without_arguments_it_says_how_it_is_used() -> None:
    assert packages().returncode == 2
    assert packages("clean").returncode == 2
