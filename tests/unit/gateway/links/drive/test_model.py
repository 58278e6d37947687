"""What a gateway that was started again makes of the drive program's first report."""

import pytest

from gateway.links.drive.model import DriveModel
from gateway.links.drive.state import DriveSpec
from gateway.links.reconciler import Reconciler
from gateway.status.teleop import DrivePhase
from tests.support.drive_views import actual

ENABLED_PHASES = [each for each in DrivePhase if each is not DrivePhase.DISABLED]


@pytest.mark.parametrize("phase", DrivePhase)
def test_driving_that_was_disabled_stays_so_in_every_phase(phase: DrivePhase) -> None:
    reconciler = Reconciler(1000, DriveModel(enabled_at_start=True))
    reconciler.take_report(actual(applied_revision=77, phase=phase, enabled=False), 0.0)
    assert (reconciler.desired.revision, reconciler.desired.spec) == (77, DriveSpec(enabled=False))
    assert reconciler.pending() is None
    assert not reconciler.view.enabled


@pytest.mark.parametrize("at_start", [True, False])
@pytest.mark.parametrize("phase", ENABLED_PHASES)
def test_where_driving_was_enabled_the_configuration_counts(phase: DrivePhase, at_start: bool) -> None:
    model = DriveModel(enabled_at_start=at_start)
    report = actual(phase=phase, enabled=True)
    assert model.adopt(model.initial, report) == (DriveSpec(enabled=at_start), True)


@pytest.mark.parametrize("at_start", [True, False])
def test_a_drive_program_that_was_started_again_gets_the_configuration(at_start: bool) -> None:
    model = DriveModel(enabled_at_start=at_start)
    for phase in (DrivePhase.DISABLED, DrivePhase.STOPPED):
        report = actual(applied_revision=0, phase=phase, enabled=False)
        assert model.adopt(model.initial, report) == (DriveSpec(enabled=at_start), True)


def test_of_an_earlier_release_of_the_drive_program_the_phase_counts() -> None:
    model = DriveModel(enabled_at_start=True)
    spec, must_be_applied = model.adopt(model.initial, actual(phase=DrivePhase.DISABLED, enabled=None))
    assert (spec, must_be_applied) == (DriveSpec(enabled=False), False)
    assert model.adopt(model.initial, actual(phase=DrivePhase.STOPPED, enabled=None)) == (model.initial, True)
