"""Where a robot stands: the first rule that applies."""

import pytest

from fleet.standing import AWAY_AFTER_S, Evidence, Standing, standing


@pytest.mark.parametrize(
    ("evidence", "expected"),
    [
        (Evidence(enrolled=True, age_s=0.0, gateway_reachable=True), Standing.UP),
        (Evidence(enrolled=True, age_s=AWAY_AFTER_S, gateway_reachable=True), Standing.UP),
        (Evidence(enrolled=True, age_s=AWAY_AFTER_S + 0.1, gateway_reachable=True), Standing.AWAY),
        (Evidence(enrolled=True, age_s=1.0), Standing.NO_GATEWAY),
        (Evidence(enrolled=True, age_s=99.0), Standing.AWAY),
        (Evidence(enrolled=True), Standing.NEVER_SEEN),
        (Evidence(enrolled=True, age_s=1.0, readable=False), Standing.UNREADABLE),
        (Evidence(enrolled=True, revoked=True, age_s=1.0, gateway_reachable=True), Standing.REVOKED),
        (Evidence(enrolled=False, age_s=1.0, gateway_reachable=True), Standing.NOT_ENROLLED),
    ],
)
def test_the_first_rule_decides(evidence: Evidence, expected: Standing) -> None:
    assert standing(evidence) is expected
