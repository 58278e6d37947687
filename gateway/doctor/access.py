"""Whether what the gateway needs to ask callers who they are is there, and for how long."""

import time
from datetime import UTC, datetime

from common.errors import UserError
from common.findings import Finding, good, note, wrong
from gateway.access.command import to_type
from gateway.access.credential import State
from gateway.access_control import read_access
from gateway.config import SecuritySettings


def access_finding(settings: SecuritySettings) -> Finding:
    """Reads the credentials as the gateway does."""
    assert settings.credentials is not None, "there is nothing to look at without them"
    try:
        loaded = read_access(settings, settings.credentials)
    except UserError as error:
        return wrong("access", error.what, "The gateway does not start with it", error.remedy)
    now_s = time.time()
    valid = sum(each.state(now_s) is State.VALID for each in loaded.store.credentials.values())
    if not valid:
        return note(
            "access",
            f"no credential in {settings.credentials} is valid: nobody can call",
            "Whoever calls must show one",
            f"Type: {to_type('add NAME --role operator')}",
        )
    ends = [datetime.fromtimestamp(each, UTC).date().isoformat() for each in loaded.ends_s.values()]
    until = f"; the certificate is good until {min(ends)}" if ends else ""
    return good("access", f"credentials that are valid: {valid}{until}")
