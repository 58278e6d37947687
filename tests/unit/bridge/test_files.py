"""The files of a configuration, and what to do about errors of the gateway."""

from pathlib import Path

import pytest

from bridge.config import BridgeSettings, GatewaySettings, HubSettings
from bridge.files import check_files
from bridge.robot.gateway import NEW_LOGIN, credentials, explained, remedy
from common.errors import UserError
from common.reasons import Reason
from console.client.errors import GatewayError, NotAllowed, NotTrusted, Unreachable

LOGIN = (
    "# Robot Gateway login 1\nrobot: lab\nname: bridge\nrole: viewer\ntoken: rgt-1.secret\nauthority:\nPEM\n"
)


def put(path: Path, text: str, mode: int = 0o600) -> Path:
    path.write_text(text, encoding="utf-8")
    path.chmod(mode)
    return path


def test_a_login_has_all_that_a_connection_needs(tmp_path: Path) -> None:
    found = credentials(GatewaySettings(login=put(tmp_path / "login", LOGIN)))
    assert (found.token, found.ca_certificate) == ("rgt-1.secret", b"PEM\n")
    check_files(BridgeSettings(gateway=GatewaySettings(login=tmp_path / "login")))


@pytest.mark.parametrize(
    ("text", "mode", "what", "todo"),
    [
        ("", 0o600, "this is not a login", NEW_LOGIN),
        (LOGIN.replace("token", "other"), 0o600, "neither a token nor a key", NEW_LOGIN),
        (LOGIN, 0o640, "others may read", "chmod 600"),
    ],
)
def test_a_login_that_is_none_says_what_to_do_here(
    tmp_path: Path, text: str, mode: int, what: str, todo: str
) -> None:
    with pytest.raises(UserError, match=what) as caught:
        credentials(GatewaySettings(login=put(tmp_path / "login", text, mode)))
    assert str(tmp_path / "login") in caught.value.what
    assert todo in caught.value.remedy
    assert "secret" not in str(caught.value)


@pytest.mark.parametrize("key", ["ca", "credentials", "receipts"])
def test_a_missing_file_of_the_enrolment_is_named(tmp_path: Path, key: str) -> None:
    hub = HubSettings.model_validate({key: tmp_path / "none"})
    with pytest.raises(UserError, match=f"hub.{key}: .*none can't be read") as caught:
        check_files(BridgeSettings(hub=hub))
    assert "robot-bridge enroll" in caught.value.remedy


@pytest.mark.parametrize("key", ["credentials", "receipts"])
def test_a_file_with_something_else_is_refused(tmp_path: Path, key: str) -> None:
    hub = HubSettings.model_validate({key: put(tmp_path / "file", "anything")})
    with pytest.raises(UserError, match="file"):
        check_files(BridgeSettings(hub=hub))


def refused(error: GatewayError, reason: str) -> GatewayError:
    error.reason = reason
    return error


@pytest.mark.parametrize(
    ("error", "helps"),
    [
        (refused(NotAllowed("no"), Reason.CREDENTIAL_REVOKED), True),
        (refused(NotAllowed("no"), Reason.CREDENTIAL_MISSING), True),
        (refused(NotAllowed("no", "Wait"), Reason.LOCKED_OUT), False),
        (NotTrusted("no"), True),
        (Unreachable("no"), False),
    ],
)
def test_a_new_login_is_advised_where_it_helps(error: GatewayError, *, helps: bool) -> None:
    assert (remedy(error) == NEW_LOGIN) is helps
    assert explained(error) == f"no. {remedy(error)}"
