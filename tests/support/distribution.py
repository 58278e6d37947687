"""Which tests run at the same time, and in which order.

pytest-xdist's workers get whole files, the longest first. Those files of tests/e2e/containers that deploy the
system are two units, those that share the containers of `_shared_demo` (its conftest.py) and the others,
because the start of a deployment takes all processors. What starts a whole robot with video or in containers,
and measures time, gets the mark `alone` for the same reason. So does what drives against time: after 250 ms
without a processor its driver counts as lost.

A worker is a foreground or a background one. Encoders, cameras and containers that get no processor for a
second count as failed, and a driver who gets none for less stops the robot, so their files (`is_paced`) are
for the foreground, two at a time. The other files mostly wait; background workers run them with what the
foreground leaves of the processors.
"""

import os
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, Final

import pytest
from xdist.scheduler import LoadScopeScheduling

_FOREGROUND_WORKERS: Final = 2
_BACKGROUND_NICE: Final = 10
"""A tenth of the weight of 0 (sched(7))."""
_BACKGROUND: Final = "robot_gateway_background"
_PACED_MARKS: Final = ("pytest.mark.gst", "pytest.mark.docker")
_DRIVING_FOLDERS: Final = ("/tests/integration/drive/", "/tests/integration/gateway/teleop/")

_CONTAINERS: Final = "tests/e2e/containers/"
_STAND_INS: Final = tuple(
    f"{_CONTAINERS}test_{name}.py" for name in ("upgrade_robot", "images", "compose_files")
)
"""Without a deployment: containers that sleep, images of one file, compose's own words."""
_SHARING: Final = tuple(
    f"{_CONTAINERS}test_{name}.py" for name in ("main_job", "hardening", "upgrade", "recording", "faults")
)
LONGEST: Final = (
    *_SHARING,
    *(f"{_CONTAINERS}test_{name}.py" for name in ("guarded", "bridge", "on_the_robot", "hub", "bad_ground")),
    "tests/e2e/systemd/test_install.py",
    "tests/e2e/systemd/test_robot.py",
    "tests/e2e/containers/test_upgrade_robot.py",
    "tests/e2e/test_release.py",
    "tests/integration/tap/test_to_the_viewer.py",
    "tests/e2e/test_demo.py",
    "tests/integration/console/receiver/test_direct.py",
    "tests/integration/preview/test_adaptive_link.py",
    "tests/integration/recorder/test_intake.py",
    "tests/integration/recorder/test_disk.py",
    "tests/integration/console/monitor/test_driving.py",
    "tests/integration/gateway/access/test_takes_effect.py",
    "tests/integration/bench/test_video.py",
    "tests/integration/bridge/test_cluster.py",
    "tests/integration/console/monitor/test_cockpit.py",
    "tests/integration/console/monitor/test_sizes.py",
    "tests/integration/bridge/uploads/test_killed_receivers.py",
    "tests/integration/bridge/test_events.py",
    "tests/integration/bench/test_drive.py",
    "tests/integration/bridge/uploads/test_uploading.py",
    "tests/integration/console/test_discovery.py",
    "tests/integration/console/test_client.py",
    "tests/integration/preview/test_cameras.py",
    "tests/integration/preview/test_capture_time.py",
    "tests/integration/preview/test_listener.py",
    "tests/integration/hub/test_silent_node.py",
    "tests/integration/gateway/test_hostile_callers.py",
    "tests/integration/hub/receiver/test_store_fails.py",
    "tests/integration/tap/test_program.py",
    "tests/integration/preview/test_fallback.py",
    "tests/integration/console/monitor/test_recording.py",
    "tests/integration/gateway/test_idle_connections.py",
    "tests/integration/gateway/ros/test_rates.py",
    "tests/integration/fleet/test_connection.py",
    "tests/integration/fuzz/test_fuzz.py",
    "tests/integration/console/viewer/test_window.py",
    "tests/integration/bench/test_rec.py",
    "tests/integration/gateway/ros/test_seen_by_operators.py",
    "tests/integration/preview/test_runner.py",
    "tests/integration/console/viewer/test_command.py",
    "tests/integration/hub/test_revocation.py",
    "tests/integration/preview/test_sources.py",
    "tests/integration/bench/test_rec_video.py",
    "tests/integration/console/viewer/test_decoders.py",
    "tests/integration/gateway/ros/test_freshness.py",
    "tests/integration/console/monitor/test_with_a_robot.py",
    "tests/integration/preview/test_encrypted.py",
    "tests/integration/preview/test_camera_formats.py",
    "tests/integration/console/viewer/test_session.py",
    "tests/integration/gateway/ros/test_other_users.py",
    "tests/integration/preview/test_service.py",
    "tests/integration/gateway/links/test_service_link.py",
    "tests/integration/console/monitor/test_guarded.py",
    "tests/integration/gateway/ros/test_publishers.py",
    "tests/integration/gateway/test_blocked_addresses.py",
    "tests/integration/console/monitor/test_practice.py",
    "tests/integration/console/viewer/test_picture_age.py",
    "tests/integration/hub/receiver/test_largest.py",
    "tests/integration/preview/test_video_tap.py",
    "tests/e2e/test_install_console.py",
    "tests/integration/preview/test_lossy_link.py",
    "tests/integration/console/test_fleet_get.py",
    "tests/integration/gateway/links/test_preview.py",
    "tests/integration/gateway/ros/test_no_harm.py",
    "tests/integration/gateway/teleop/test_shared_robot.py",
    "tests/integration/bridge/test_commands.py",
    "tests/integration/gateway/bridge/test_status.py",
    "tests/integration/console/viewer/test_guarded.py",
    "tests/integration/console/monitor/test_hands_on.py",
    "tests/integration/preview/test_program.py",
    "tests/integration/gateway/access/test_programs.py",
    "tests/integration/bridge/test_login.py",
    "tests/integration/recorder/test_kill.py",
    "tests/integration/hub/test_command_line.py",
    "tests/integration/gateway/access/test_viewer_flood.py",
    "tests/integration/console/test_robotctl.py",
    "tests/integration/gateway/bridge/test_calls.py",
    "tests/integration/gateway/test_half_open.py",
)
"""Files of more than 10 s beside the tests that run alone, the longest first: one that a worker began late
would leave the others idle."""
_RANKS: Final = {file: rank for rank, file in enumerate(LONGEST)}


# First, because pytest selects by marks in the same hook.
@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Marks what runs alone, and puts the longest files first."""
    for item in items:
        marks = {mark.name for mark in item.iter_markers()}
        if "timed" in marks and ("docker" in marks or {"ros", "gst"} <= marks or _drives(item.path)):
            item.add_marker(pytest.mark.alone)
    items.sort(key=lambda item: _RANKS.get(_file_of(item.nodeid), len(_RANKS)))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> LoadScopeScheduling:
    """Returns the scheduler that keeps the units below together."""
    return _ByFile(config, log)


class _Workers:
    """Decides which workers are in the foreground; lives in the process that starts them."""

    def __init__(self) -> None:
        self._foreground: set[Any] = set()

    @pytest.hookimpl(optionalhook=True)
    def pytest_configure_node(self, node: Any) -> None:
        """Called before a worker starts: the first ones, and what replaces them, are in the foreground."""
        background = len(self._foreground) >= _FOREGROUND_WORKERS
        node.workerinput[_BACKGROUND] = background
        if not background:
            self._foreground.add(node)

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: Any) -> None:
        """Called when a worker has ended."""
        self._foreground.discard(node)


def pytest_configure(config: pytest.Config) -> None:
    """Has this worker, and all that it will start, yield to the foreground if it is a background one."""
    if not hasattr(config, "workerinput"):
        config.pluginmanager.register(_Workers())
    elif config.workerinput[_BACKGROUND]:
        os.nice(_BACKGROUND_NICE)
        # Where the kernel groups processes by session, nice values count within a session only, and that of
        # the session counts between them (sched(7), "The autogroup feature").
        autogroup = Path("/proc/self/autogroup")
        if autogroup.exists():
            os.setsid()
            autogroup.write_text(str(_BACKGROUND_NICE), encoding="ascii")


class _ByFile(LoadScopeScheduling):  # type: ignore[misc]  # xdist has no types
    def remove_node(self, node: Any) -> str | None:
        """Returns the test in which a worker has crashed.

        The scheduler above would hand out all that the worker had: that test once more, and files that were
        done, for whose end it then waited for ever.
        """
        units: dict[str, dict[str, bool]] = self.assigned_work[node]
        begun = next((unit for unit in units.values() if not all(unit.values())), None)
        crashed = next(test for test, done in begun.items() if not done) if begun else None
        if begun and crashed:
            begun[crashed] = True
        for scope in [scope for scope, unit in units.items() if all(unit.values())]:
            del units[scope]
        super().remove_node(node)
        return crashed

    def schedule(self) -> None:
        """Gives a worker that replaces another two files: it begins a test only when it knows the next."""
        super().schedule()
        for node in self.nodes:
            self._reschedule(node)

    def _reschedule(self, node: Any) -> None:
        """Gives a worker more to do, or ends it where what is left is not for it."""
        if node not in self.registered_collections:
            return  # It replaces another one, and has its turn when it has collected the tests.
        if not node.shutting_down and self._next_unit(node) is None:
            node.shutdown()
        super()._reschedule(node)

    def _assign_work_unit(self, node: Any) -> None:
        unit = self._next_unit(node)
        if unit is None:
            node.shutdown()
            return
        self.workqueue.move_to_end(unit, last=False)
        # A worker that has crashed meanwhile can be sent nothing. Its end is reported next, and remove_node
        # gives to others what it had, this unit as well.
        with suppress(OSError):
            super()._assign_work_unit(node)

    def _next_unit(self, node: Any) -> str | None:
        """Returns the unit that the worker is to run next.

        In the foreground those that are paced come first, so that others are left for the background.
        """
        background = node.workerinput[_BACKGROUND]
        units: dict[bool, str] = {}
        for unit in self.workqueue:
            units.setdefault(unit == _CONTAINERS or is_paced(self.config.rootpath / unit), unit)
        return units.get(False) if background else units.get(True, units.get(False))

    def _split_scope(self, nodeid: str) -> str:
        return unit_of(_file_of(nodeid))


def unit_of(file: str) -> str:
    """Returns what names the file's unit: files with the same name run on one worker, one after the other."""
    if file in _SHARING:
        return _SHARING[0]
    return _CONTAINERS if file.startswith(_CONTAINERS) and file not in _STAND_INS else file


def shares_a_deployment(item: pytest.Item) -> bool:
    """Returns whether the test is of those files that share the containers of `_shared_demo`."""
    return _file_of(item.nodeid) in _SHARING


@cache
def is_paced(file: Path) -> bool:
    """Returns whether the file's tests run what fails where it gets no processor in time."""
    if _drives(file):
        return True
    text = file.read_text(encoding="utf-8")
    return any(mark in text for mark in _PACED_MARKS)


def _drives(file: Path) -> bool:
    return any(folder in file.as_posix() for folder in _DRIVING_FOLDERS)


def _file_of(nodeid: str) -> str:
    return nodeid.partition("::")[0]
