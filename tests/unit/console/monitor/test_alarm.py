"""When an alarm sounds, and what an acknowledgement mutes."""

from console.client.results import Fault, FaultSeverity
from console.monitor.alarm import LOST_LINK, REPEAT_S, Alarm, occurrence


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
    alarm.show(faults)
    return alarm


def test_the_sound_is_off_by_default() -> None:
    alarm = Alarm()
    alarm.show([fault()])
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
    assert not alarm.is_pending(occurrence(first))
    assert alarm.is_pending(occurrence(second))
    assert alarm.due(0)
    alarm.acknowledge(occurrence(second))
    assert not alarm.due(REPEAT_S)


def test_a_fault_that_comes_back_alarms_again() -> None:
    alarm = alarm_of(fault())
    alarm.acknowledge()
    alarm.show([fault(active=False)])
    assert alarm.pending == 0
    alarm.show([fault(times_raised=2)])
    assert alarm.due(0)


def test_the_status_that_follows_keeps_the_acknowledgement() -> None:
    alarm = alarm_of(fault())
    alarm.acknowledge()
    alarm.show([fault()])
    assert alarm.pending == 0


def test_neither_information_nor_a_cleared_fault_alarms() -> None:
    assert not alarm_of(fault(severity=FaultSeverity.INFO), fault("x", active=False)).due(0)


def test_a_fault_is_new_once() -> None:
    alarm, one, other = Alarm(), fault("a"), fault("b")
    assert alarm.show([one]) == [one]
    alarm.acknowledge()
    assert alarm.show([one, other]) == [other]


def test_turned_on_again_it_sounds_at_once() -> None:
    alarm = alarm_of(fault())
    assert alarm.due(0)
    alarm.sound_on = False
    assert not alarm.due(0.5)
    alarm.sound_on = True
    assert alarm.due(1.0)


def test_an_acknowledged_warning_that_becomes_an_error_alarms_again() -> None:
    warning, error = fault("motor", FaultSeverity.WARNING), fault("motor")
    alarm = alarm_of(warning)
    alarm.acknowledge()
    assert alarm.show([error]) == [error], "a toast"
    assert alarm.is_pending(occurrence(error)), "a button"
    assert alarm.due(0), "a tone"
    alarm.acknowledge()
    assert (alarm.show([error]), alarm.pending) == ([], 0)


def test_a_fall_alarms_no_more_but_the_next_rise_does() -> None:
    warning, error = fault("motor", FaultSeverity.WARNING), fault("motor")
    alarm = alarm_of(error)
    alarm.acknowledge()
    assert (alarm.show([warning]), alarm.pending) == ([], 0)
    assert alarm.show([error]) == [error]
    assert alarm.pending == 1


def test_a_warning_that_rises_before_its_acknowledgement_is_shown_again_and_counted_once() -> None:
    alarm, error = alarm_of(fault("motor", FaultSeverity.WARNING)), fault("motor")
    assert alarm.show([error]) == [error]
    assert alarm.pending == 1


def test_a_lost_connection_alarms_once_for_each_loss() -> None:
    alarm = alarm_of()
    alarm.show([], link_lost=True)
    assert alarm.is_pending(LOST_LINK)
    assert alarm.due(0)
    alarm.acknowledge(LOST_LINK)
    alarm.show([], link_lost=True)
    assert not alarm.due(REPEAT_S)
    alarm.show([])
    assert alarm.pending == 0
    alarm.show([], link_lost=True)
    assert alarm.due(2 * REPEAT_S)


def test_a_lost_connection_and_the_last_known_faults_are_acknowledged_apart() -> None:
    alarm, known = alarm_of(fault()), fault()
    alarm.show([known], link_lost=True)
    alarm.acknowledge(occurrence(known))
    assert alarm.is_pending(LOST_LINK)
    alarm.acknowledge()
    assert alarm.pending == 0
