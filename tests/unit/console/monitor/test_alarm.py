"""When an alarm sounds, and what an acknowledgement mutes."""

from console.client.results import Fault, FaultSeverity
from console.monitor.alarm import REPEAT_S, Alarm, occurrence


def fault(
    name: str = "odometry.stale",
    severity: FaultSeverity = FaultSeverity.ERROR,
    *,
    active: bool = True,
    times_raised: int = 1,
) -> Fault:
    return Fault(
        id=name,
        severity=severity,
        component="",
        message=name,
        remedy="",
        active=active,
        age_ms=0,
        cleared_age_ms=None if active else 0,
        times_raised=times_raised,
    )


def alarm_of(*faults: Fault) -> Alarm:
    alarm = Alarm()
    alarm.sound_on = True
    alarm.show_faults(faults)
    return alarm


def test_the_sound_is_off_by_default() -> None:
    alarm = Alarm()
    alarm.show_faults([fault()])
    assert not alarm.due(0)


def test_it_repeats_until_it_is_acknowledged() -> None:
    alarm = alarm_of(fault())
    assert [alarm.due(at) for at in (0, REPEAT_S / 2, REPEAT_S, REPEAT_S * 1.5)] == [True, False, True, False]
    alarm.acknowledge()
    assert not alarm.due(10 * REPEAT_S)


def test_only_this_fault_is_muted() -> None:
    first, second = fault("a"), fault("b", FaultSeverity.WARNING)
    alarm = alarm_of(first, second)
    alarm.acknowledge(occurrence(first))
    assert not alarm.is_pending(first)
    assert alarm.is_pending(second)
    assert alarm.due(0)
    alarm.acknowledge(occurrence(second))
    assert not alarm.due(REPEAT_S)


def test_a_fault_that_comes_back_alarms_again() -> None:
    alarm = alarm_of(fault())
    alarm.acknowledge()
    alarm.show_faults([fault(active=False)])
    assert alarm.pending == 0
    alarm.show_faults([fault(times_raised=2)])
    assert alarm.due(0)


def test_the_status_that_follows_keeps_the_acknowledgement() -> None:
    alarm = alarm_of(fault())
    alarm.acknowledge()
    alarm.show_faults([fault()])
    assert alarm.pending == 0


def test_neither_information_nor_a_cleared_fault_alarms() -> None:
    assert not alarm_of(fault(severity=FaultSeverity.INFO), fault("x", active=False)).due(0)


def test_a_fault_is_new_once() -> None:
    alarm, one, other = Alarm(), fault("a"), fault("b")
    assert alarm.show_faults([one]) == [one]
    alarm.acknowledge()
    assert alarm.show_faults([one, other]) == [other]


def test_turned_on_again_it_sounds_at_once() -> None:
    alarm = alarm_of(fault())
    assert alarm.due(0)
    alarm.sound_on = False
    assert not alarm.due(0.5)
    alarm.sound_on = True
    assert alarm.due(1.0)
