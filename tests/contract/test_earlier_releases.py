"""What a robot of a released version has on its disk is good for this one: an upgrade keeps all of it.

`released/VERSION` has a configuration with the keys that the version documented, but for those that exclude
others of them, and a list of credentials in its form; a further release adds a folder.
tests/e2e/containers/test_real_upgrade.py upgrades such a robot.
"""

from pathlib import Path

import pytest

from common.config import Settings, load
from gateway.access.credential import Validity
from gateway.access.role import Role
from gateway.access.store import parse_store
from gateway.access.token import parse_token, verify
from gateway.config import GatewaySettings
from preview.config import PreviewSettings

RELEASED = Path(__file__).parent / "released"
VERSIONS = sorted(path.name for path in RELEASED.iterdir())
CONFIGURATIONS: list[tuple[str, type[Settings]]] = [
    ("gateway.yaml", GatewaySettings),
    ("preview.yaml", PreviewSettings),
]
TOKEN = f"rgt-0123456789ab.{'A' * 43}"
"""Of which the lists have the hash."""
LATER_S = 1_795_000_000.0


def test_the_first_release_is_among_them() -> None:
    assert "0.1.0" in VERSIONS


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize(("file", "settings"), CONFIGURATIONS, ids=["gateway", "preview"])
def test_every_key_of_its_configuration_is_accepted(
    version: str, file: str, settings: type[Settings]
) -> None:
    load(settings, RELEASED / version / file)


@pytest.mark.parametrize(
    "camera",
    [
        "{kind: v4l2, device: /dev/video11}",
        "{kind: test}",
        "{kind: file, path: /videos/loop.mp4}",
        "{kind: gst, description: videotestsrc ! videoconvert}",
    ],
)
def test_the_other_cameras_of_0_1_0_are_accepted(camera: str, tmp_path: Path) -> None:
    """A file has one camera: that of `released` is another one."""
    file = tmp_path / "preview.yaml"
    file.write_text(f"source: {camera}\n", encoding="utf-8")
    load(PreviewSettings, file)


@pytest.mark.parametrize("version", VERSIONS)
def test_its_credentials_are_valid_for_whom_they_were(version: str) -> None:
    store = parse_store((RELEASED / version / "credentials.json").read_text(encoding="utf-8"))
    token = parse_token(TOKEN)
    assert token
    anna, ben = store.credentials[token.credential_id], store.credentials["ba9876543210"]
    assert (anna.name, anna.role, anna.validity(LATER_S)) == ("anna", Role.OPERATOR, Validity.VALID)
    assert verify(token, anna.proof)
    assert (ben.name, ben.role, ben.validity(LATER_S)) == ("ben", Role.VIEWER, Validity.REVOKED)


def test_the_video_settings_of_0_1_0_mean_the_same() -> None:
    """Profiles were spelled with an underscore, and the adaptive bit rate was off where the file said so."""
    settings = load(PreviewSettings, RELEASED / "0.1.0/preview.yaml")
    assert settings.profiles.low_bw.bitrate_kbps == 1000
    assert settings.profiles.high_quality.fps == 60
    assert not settings.adaptive.enabled
    assert load(GatewaySettings, RELEASED / "0.1.0/gateway.yaml").preview.encrypted is False
