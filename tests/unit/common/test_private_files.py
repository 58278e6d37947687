"""Private files are replaced as a whole, all or none of a group, and stay replaced after a power loss."""

import errno
import os
from pathlib import Path

import pytest

from common.errors import UserError
from common.private_files import write_all_private, write_private


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
