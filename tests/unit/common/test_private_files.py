"""Private files are replaced as a whole, all or none of a group, and stay replaced after a power loss."""

import errno
import os
from pathlib import Path

import pytest

from common.errors import UserError
from common.private_files import make_own_directory, write_all_private, write_private
from tests.support.file_owner import files_belong_to


class Disk:
    """Records what is synchronised, and is full from the `full_at`th time on."""

    def __init__(self, full_at: int | None = None) -> None:
        self.synced: list[str] = []
        self._full_at = full_at

    def fsync(self, handle: int) -> None:
        if len(self.synced) == self._full_at:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        self.synced.append(str(Path(f"/proc/self/fd/{handle}").readlink()))


def test_a_replaced_file_survives_a_power_loss(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    disk = Disk()
    monkeypatch.setattr(os, "fsync", disk.fsync)
    write_private(tmp_path / "new" / "file", b"content")
    content, directory = disk.synced[-2:]
    assert disk.synced[0] == str(tmp_path), "it has a new entry"
    assert content.startswith(str(tmp_path / "new" / ".file."))
    assert directory == str(tmp_path / "new"), "after the content, since it has the new name"


def test_a_disk_that_is_full_in_between_changes_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = [tmp_path / name for name in ("a", "b", "c")]
    write_all_private(dict.fromkeys(files, b"old"))
    monkeypatch.setattr(os, "fsync", Disk(full_at=2).fsync)
    with pytest.raises(UserError, match="No space left"):
        write_all_private(dict.fromkeys(files, b"new"))
    assert [each.read_bytes() for each in files] == [b"old"] * 3
    assert sorted(tmp_path.iterdir()) == files, "nothing else is left behind"


def test_a_file_system_without_synchronised_directories_will_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fsync(handle: int) -> None:
        if Path(f"/proc/self/fd/{handle}").readlink().is_dir():
            raise OSError(errno.EINVAL, os.strerror(errno.EINVAL))

    monkeypatch.setattr(os, "fsync", fsync)
    write_private(tmp_path / "file", b"content")
    assert (tmp_path / "file").read_bytes() == b"content"


def test_a_file_of_another_user_stays_that_users(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[tuple[int, int]] = []
    monkeypatch.setattr(os, "fchown", lambda _handle, user, group: given.append((user, group)))
    write_private(tmp_path / "file", b"old", keep_owner=True)
    assert given == [], "there was none"
    write_private(tmp_path / "file", b"new", keep_owner=True)
    status = (tmp_path / "file").stat()
    assert given == [(status.st_uid, status.st_gid)]
    assert (tmp_path / "file").read_bytes() == b"new"


def test_a_directory_of_ones_own_is_closed_to_others(tmp_path: Path) -> None:
    make_own_directory(tmp_path / "new")
    assert (tmp_path / "new").stat().st_mode & 0o7777 == 0o700
    (tmp_path / "open").mkdir()
    (tmp_path / "open").chmod(0o777)
    make_own_directory(tmp_path / "open")
    assert (tmp_path / "open").stat().st_mode & 0o7777 == 0o700


def test_a_directory_of_another_user_is_left_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As one that was made under a foreseeable name in /tmp; root could change its mode all the same."""
    tmp_path.chmod(0o755)
    files_belong_to(os.geteuid() + 1, monkeypatch)
    with pytest.raises(PermissionError, match="not this user's own"):
        make_own_directory(tmp_path)
    assert tmp_path.stat().st_mode & 0o7777 == 0o755


def test_neither_a_link_nor_the_directory_of_everyone_is_ones_own(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path)
    with pytest.raises(OSError, match=r"Not a directory|symbolic links"):
        make_own_directory(tmp_path / "link")
    (tmp_path / "everyones").mkdir()
    (tmp_path / "everyones").chmod(0o1777)
    with pytest.raises(PermissionError, match="not this user's own"):
        make_own_directory(tmp_path / "everyones")
