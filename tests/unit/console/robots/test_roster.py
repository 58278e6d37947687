"""Robots to switch to: known ones first, then discovered ones."""

from pathlib import Path

from common.errors import UserError
from console.robots.robots_file import Robot, RobotsFile
from console.robots.roster import RobotChoice, Roster
from tests.support.found_robots import FoundRobots

KNOWN = RobotsFile(Path("x"), {"lab1": Robot(target="10.0.0.1:50051"), "lab2": Robot(target="b:50051")})


def test_known_ones_come_first_and_no_robot_twice() -> None:
    found = [
        RobotChoice("LAB-1", "10.0.0.1:50051", known=False),
        RobotChoice("new", "c:50051", known=False),
    ]
    roster = Roster(lambda: KNOWN, FoundRobots(found))
    assert [(choice.name, choice.known) for choice in roster.choices()] == [
        ("lab1", True),
        ("lab2", True),
        ("new", False),
    ]


def test_a_broken_file_is_reported_and_hides_no_discovered_robot() -> None:
    def broken() -> RobotsFile:
        raise UserError("config.toml: not TOML", "")

    roster = Roster(broken, FoundRobots([RobotChoice("new", "c:50051", known=False)]))
    assert [choice.name for choice in roster.choices()] == ["new"]
    assert roster.error
    assert "not TOML" in str(roster.error)


def test_the_file_is_read_anew_each_time() -> None:
    files = iter([RobotsFile(Path("x")), KNOWN])
    roster = Roster(lambda: next(files))
    assert [len(roster.choices()), len(roster.choices())] == [0, 2]
