"""SHA256SUMS, judged by sha256sum."""

import subprocess
from pathlib import Path

from release_program.sums import write_sums


def check(directory: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["sha256sum", "--check", "--quiet", "--strict", "SHA256SUMS"],
        cwd=directory,
        capture_output=True,
        text=True,
        check=False,
    )


def test_sha256sum_accepts_it_and_notices_damage(tmp_path: Path) -> None:
    for name in ("b", "a/c"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(name)
    write_sums(tmp_path)
    lines = (tmp_path / "SHA256SUMS").read_text().splitlines()
    assert [line.split("  ")[1] for line in lines] == ["a/c", "b"]
    assert check(tmp_path).returncode == 0
    (tmp_path / "b").write_text("B")
    assert "b: FAILED" in check(tmp_path).stdout
