"""The check that ends the build of a robot's image with a stand-in in it."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[3]


def refuse(*directories: Path) -> subprocess.CompletedProcess[str]:
    command = [ROOT / "docker" / "refuse-stand-ins", *directories]
    return subprocess.run(command, capture_output=True, text=True, timeout=30, check=False)


def test_a_stand_in_is_refused_by_name() -> None:
    """The development environment has both."""
    ended = refuse(Path(sys.prefix))
    assert ended.returncode == 1
    assert "share/yolo_msgs" in ended.stderr
    assert "share/vision_msgs" in ended.stderr


def test_a_stand_in_below_a_link_is_refused(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(sys.prefix)
    assert refuse(tmp_path / "link").returncode == 1


def test_the_real_packages_pass(tmp_path: Path) -> None:
    (tmp_path / "share" / "yolo_msgs").mkdir(parents=True)
    (tmp_path / "share" / "yolo_msgs" / "package.xml").touch()
    ended = refuse(tmp_path)
    assert (ended.returncode, ended.stderr) == (0, "")


def test_a_directory_that_is_missing_is_no_pass(tmp_path: Path) -> None:
    assert refuse(tmp_path / "missing").returncode != 0
