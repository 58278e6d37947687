"""Which faults make an incident."""

from recorder.recording.incidents import Incidents, Rules


def test_severity_switch_and_list_decide() -> None:
    incidents = Incidents(Rules(min_severity=2, ignore=frozenset({"battery.low"})))
    assert incidents.wanted("vision.silent", 2)
    assert not incidents.wanted("vision.silent", 1)
    assert not incidents.wanted("battery.low", 3)
    assert not Incidents(Rules(enabled=False)).wanted("vision.silent", 3)


def test_a_fault_makes_one_incident_until_it_has_cooled_down() -> None:
    incidents = Incidents(Rules(cooldown_s=60))
    assert incidents.earlier("a", 0.0, ()) is None
    incidents.made("a", "first", 0.0)
    assert incidents.earlier("a", 59.9, ()) == "first"
    assert incidents.earlier("b", 59.9, ()) is None
    assert incidents.earlier("a", 60.0, ()) is None
    assert incidents.earlier("a", 60.0, ("first",)) == "first", "it is being made still"


def test_what_is_remembered_is_bounded() -> None:
    incidents = Incidents(Rules())
    for number in range(5000):
        incidents.made(str(number), "x", 0.0)
    assert incidents.earlier("4999", 0.0, ()) == "x"
    assert incidents.earlier("0", 0.0, ()) is None
