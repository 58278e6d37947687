"""The key of receipts is replaced: what the hub's directory has then, and who counts whose receipts."""

from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from common.errors import UserError
from fleet.receipt_keys import ReceiptError, confirmed, read_public_keys, read_signer
from hub.cli import app
from hub.receipts import MOST_KEYS
from omniseer.fleet.v1.upload_pb2 import Receipt

RECEIPT = Receipt(fleet="lab", robot="r1", recording_id="one", size=3, sha256=b"s" * 32)


def typed(*words: str) -> Result:
    return CliRunner().invoke(app, words, catch_exceptions=False)


@pytest.fixture
def hub(tmp_path: Path) -> Path:
    made = tmp_path / "hub"
    assert typed("init", "--out", str(made), "--fleet", "lab").exit_code == 0
    return made


def test_a_new_key_signs_and_the_old_one_counts_until_it_is_retired(hub: Path) -> None:
    public = hub / "receipts.pub"
    old, old_keys = read_signer(hub / "receipts.key"), read_public_keys(public)
    assert "2 count now" in typed("receipts", "rotate", "--dir", str(hub)).output
    new, keys = read_signer(hub / "receipts.key"), read_public_keys(public)
    assert keys == (new.public_key, old.public_key)
    for signer in (old, new):
        assert confirmed(signer.sign(RECEIPT), keys, RECEIPT)
    with pytest.raises(ReceiptError, match=r"receipts\.pub does not have"):
        confirmed(new.sign(RECEIPT), old_keys, RECEIPT)
    assert "1 old keys were removed" in typed("receipts", "retire", "--dir", str(hub)).output
    assert read_public_keys(public) == (new.public_key,)
    assert read_signer(hub / "receipts.key").public_key == new.public_key
    assert all((hub / name).stat().st_mode & 0o077 == 0 for name in ("receipts.key", "receipts.pub"))


def test_people_and_receivers_get_all_keys_that_count(hub: Path, tmp_path: Path) -> None:
    typed("receipts", "rotate", "--dir", str(hub))
    text = (hub / "receipts.pub").read_text(encoding="ascii")
    assert f"receivers: {', '.join(text.split())}\n" in typed("operator", "anna", "--dir", str(hub)).output
    typed("receiver-credentials", "--out", str(tmp_path / "receiver"), "--dir", str(hub))
    for name in ("receipts.key", "receipts.pub"):
        assert (tmp_path / "receiver" / name).read_bytes() == (hub / name).read_bytes()


def test_there_are_never_more_keys_than_are_read(hub: Path) -> None:
    for _ in range(MOST_KEYS - 1):
        typed("receipts", "rotate", "--dir", str(hub))
    before = (hub / "receipts.key").read_bytes()
    with pytest.raises(UserError, match="keys count already") as refused:
        typed("receipts", "rotate", "--dir", str(hub))
    assert f"receipts retire --dir {hub}" in (refused.value.remedy or "")
    assert (hub / "receipts.key").read_bytes() == before


@pytest.mark.parametrize("command", ["rotate", "retire"])
def test_it_takes_a_hubs_directory(tmp_path: Path, command: str) -> None:
    (tmp_path / "other").mkdir()
    with pytest.raises(UserError, match="no hub's directory"):
        typed("receipts", command, "--dir", str(tmp_path / "other"))
    assert list((tmp_path / "other").glob("receipts*")) == []
