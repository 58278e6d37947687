"""Names on the wire: subjects, streams and buckets of a fleet's account (docs/decisions/0011)."""

import re
from typing import Final

LARGEST_MESSAGE: Final = 512 * 1024
"""Bytes that streams take and credentials permit; a server disconnects a client that sends more."""
INBOXES: Final = "_INBOX"
"""Prefix of the inboxes of people and programs of the hub, which share it."""
MOST_FILES: Final = 20_000
"""Of a recording: the names of so many segments take 360 KiB, which one message has room for."""
ROBOT_NAME: Final = re.compile(r"[a-z0-9](?:[a-z0-9-]{0,61}[a-z0-9])?")
"""A robot's name, and a fleet's: a DNS label (RFC 1123 2.1), and so one token of a subject and a key."""
NAME_EXPECTED: Final = "a name of at most 63 characters of a-z, 0-9 and -, robot-2 for example"
"""The same for people, where a configuration has another text."""
RECORDING_ID: Final = re.compile(r"[A-Za-z0-9_-]{1,64}")
"""Without a dot, and so one token of a key."""

EVENTS: Final = "fleet_events"
"""Stream of EventBatch. One message per subject; a second one is refused."""
COMMANDS: Final = "fleet_commands"
"""Stream of Command. Each robot has a durable consumer of its own name."""
RESULTS: Final = "fleet_results"
"""Stream of CommandResult."""
STATES: Final = "fleet_state"
"""Key-value bucket of RobotState, by robot."""
RECORDINGS: Final = "fleet_recordings"
"""Key-value bucket of StoredRecording, by robot and recording."""
ROBOTS: Final = "fleet_robots"
"""Key-value bucket of who is enrolled: written by the hub's administration, read by the console."""
RECEIVERS: Final = "receivers"
"""Queue group of the receivers: each request is answered by one of them."""

EVENT_SUBJECTS: Final = "fleet.*.ev.>"
COMMAND_SUBJECTS: Final = "fleet.*.cmd.*"
RESULT_SUBJECTS: Final = "fleet.*.res.*"
UPLOAD_SUBJECTS: Final = "fleet.*.up.*"
READING_SUBJECTS: Final = "fleet.*.get.*"
"""People's requests for what receivers have of a robot. Robots may not use them."""


def event_subject(robot: str, run_id: str, first_sequence: int) -> str:
    """Returns the subject of a batch of events."""
    return f"fleet.{robot}.ev.{run_id}.{first_sequence}"


def event_subjects(robot: str) -> str:
    """Returns the subjects of all events of a robot."""
    return f"fleet.{robot}.ev.>"


def command_subject(robot: str, command_id: str) -> str:
    """Returns the subject of a command."""
    return f"fleet.{robot}.cmd.{command_id}"


def result_subject(robot: str, command_id: str) -> str:
    """Returns the subject of a command's result."""
    return f"fleet.{robot}.res.{command_id}"


def time_subject(robot: str) -> str:
    """Returns the subject of a robot's request for the hub's time: ConsumerInfo of its commands."""
    return f"fleet.{robot}.time"


def info_subject(stream: str) -> str:
    """Returns the subject of people's request for how full a stream is: StreamInfo."""
    return f"fleet.info.{stream}"


def upload_subject(robot: str, request: str) -> str:
    """Returns the subject of a request about an upload: "begin_file", for example."""
    return f"fleet.{robot}.up.{request}"


def reading_subject(robot: str, request: str) -> str:
    """Returns the subject of a person's request for what receivers have of a robot: "get_files"."""
    return f"fleet.{robot}.get.{request}"


def inbox_prefix(robot: str) -> str:
    """Returns the prefix of the inboxes that a robot may subscribe to, and answers to it may be sent to."""
    return f"_INBOX_{robot}"
