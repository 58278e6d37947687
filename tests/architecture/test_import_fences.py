"""House rules on who may import whom, read from the source; see docs/architecture.md for the picture."""

import ast
import re
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from graphlib import CycleError, TopologicalSorter
from itertools import groupby
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PROGRAMS = ("gateway", "preview", "drive", "recorder", "bridge", "hub", "console", "simrobot", "tap")
OURS = ("common", "fleet", *PROGRAMS, "practice")


@dataclass(frozen=True)
class Import:
    """`importer` (a file below the root) imports `module`."""

    importer: str
    line: int
    module: str


def imports_below(package: str) -> Iterator[Import]:
    for path in sorted((ROOT / package).rglob("*.py")):
        file = str(path.relative_to(ROOT))
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            match node:
                case ast.Import(names=names):
                    for name in names:
                        yield Import(file, node.lineno, name.name)
                case ast.ImportFrom(module=str(module), names=names):
                    # `from gateway import ros` imports gateway.ros as well.
                    yield Import(file, node.lineno, module)
                    for name in names:
                        yield Import(file, node.lineno, f"{module}.{name.name}")


@cache
def imports() -> tuple[Import, ...]:
    return tuple(found for package in OURS for found in imports_below(package))


def is_within(module: str, prefix: str) -> bool:
    return module == prefix or module.startswith(prefix + ".")


def offenders(importer: str, forbidden: tuple[str, ...]) -> list[str]:
    return [
        f"{found.importer}:{found.line} imports {found.module}"
        for found in imports()
        if found.importer.startswith(importer) and any(is_within(found.module, bad) for bad in forbidden)
    ]


HEAVY = ("rclpy", "gi", "PySide6")
WIRE = ("grpc", "google.protobuf", "omniseer.gateway", "omniseer.preview")


@pytest.mark.parametrize(
    ("importer", "forbidden"),
    [
        ("common/", PROGRAMS),
        *(
            (f"{one}/", (*(other for other in PROGRAMS if other != one), "practice"))
            for one in PROGRAMS
            if one != "bridge"
        ),
        # An ordinary client of the gateway, through the client's library.
        ("bridge/", (*(other for other in PROGRAMS if other not in ("bridge", "console")), "practice")),
        ("fleet/", PROGRAMS),
        *(
            (f"{one}/", ("fleet",))
            for one in ("common", "gateway", "preview", "drive", "recorder", "simrobot", "tap")
        ),
        ("fleet/errors.py", ("asyncio", "fleet", *WIRE)),
        ("fleet/identity.py", ("asyncio", "fleet.nats_client", "fleet.session", "fleet.connection", *WIRE)),
        ("hub/permissions.py", ("asyncio", "fleet.connection", "hub")),
        ("hub/server_config.py", ("asyncio", "fleet", "hub")),
        # Practice is the console with the pure core of the drive program behind it. It opens no connection.
        (
            "practice/",
            (
                *("gateway", "preview", "recorder", "rclpy", "gi", "grpc", "socket"),
                *("console.client.aio", "console.client.blocking", "console.client.transport"),
                *("drive.processes", "drive.endpoint", "drive.ros", "drive.app"),
                *("simrobot.drive_train", "simrobot.robot", "simrobot.app", "simrobot.control"),
            ),
        ),
        *(
            (f"practice/{name}.py", (*HEAVY, *WIRE, "console", "asyncio", "time", "threading"))
            for name in ("network", "robot", "scene")
        ),
        *(
            (f"fleet/{name}.py", ("nats", "nkeys", "asyncio"))
            for name in ("incoming", "names", "reading", "standing")
        ),
        ("fleet/replies.py", ("nats", "nkeys", "fleet.nats_client", "fleet.session", "fleet.connection")),
        ("bridge/", ("console.cli", "console.fleet", "console.monitor", "console.window", "console.viewer")),
        ("bridge/", HEAVY),
        ("hub/exporter/", ("hub.receiver", "hub.accounts", "hub.administration", "hub.creation", "boto3")),
        ("console/fleet/", (*HEAVY, "grpc", "nats", "nkeys", "typer", "rich", "console.cli")),
        *(
            (f"console/fleet/{name}.py", ("asyncio", "time", "google.protobuf", "omniseer"))
            for name in ("model", "columns", "values", "board")
        ),
        ("drive/", ("omniseer.gateway", "grpc", "asyncio")),
        ("preview/", ("omniseer.gateway",)),
        ("console/", ("omniseer.preview",)),
        (
            "recorder/values/",
            (
                *(*HEAVY, *WIRE, "omniseer", "asyncio", "time", "mcap"),
                *("recorder.config", "recorder.intake", "recorder.mcap", "recorder.recording"),
                *("recorder.rpc", "recorder.store", "recorder.video", "recorder.writing"),
            ),
        ),
        ("recorder/intake/", (*WIRE, "omniseer", "asyncio", "mcap", "recorder.mcap", "recorder.config")),
        ("recorder/mcap/", (*HEAVY, *WIRE, "omniseer", "asyncio", "recorder.intake", "recorder.config")),
        ("recorder/video/", (*HEAVY, *WIRE, "omniseer", "mcap", "recorder.intake", "recorder.mcap")),
        *(
            (f"recorder/video/{name}.py", ("asyncio", "time", "recorder.video.tap"))
            for name in ("access_unit", "message", "stream")
        ),
        (
            "recorder/store/",
            (*HEAVY, *WIRE, "omniseer", "mcap", "recorder.intake", "recorder.rpc", "recorder.recording"),
        ),
        ("recorder/store/retention.py", ("asyncio", "time", "os", "pathlib", "recorder")),
        ("recorder/writing/", (*HEAVY, *WIRE, "omniseer", "asyncio", "recorder.intake", "recorder.store")),
        *(
            (f"recorder/{name}.py", (*HEAVY, *WIRE, "omniseer", "asyncio", "time", "recorder"))
            for name in ("recording/lifecycle", "recording/incidents", "values/offered_qos")
        ),
        ("recorder/config/settings.py", (*HEAVY, *WIRE, "asyncio", "recorder")),
        ("recorder/recording/", (*HEAVY, *WIRE, "omniseer", "recorder.intake", "recorder.rpc")),
        *(
            (
                f"recorder/recording/{name}.py",
                (
                    "recorder.recording.assembly",
                    "recorder.recording.recorder",
                    "recorder.recording.ring_recorder",
                ),
            )
            for name in ("manual_recorder", "snapshots")
        ),
        (
            "recorder/recording/status_reader.py",
            ("recorder.recording.recorder", "recorder.recording.operations"),
        ),
        ("gateway/status/", (*HEAVY, *WIRE, "gateway.ros", "gateway.rpc", "gateway.config", "asyncio")),
        ("gateway/access/", (*HEAVY, *WIRE, "gateway.ros", "gateway.rpc", "gateway.config")),
        ("gateway/ros/", ("gateway.rpc", "gateway.links", *WIRE)),
        ("gateway/config/", (*HEAVY, *WIRE, "gateway.ros", "gateway.rpc")),
        ("gateway/platform/", (*HEAVY, *WIRE, "gateway.ros", "gateway.rpc")),
        ("gateway/observer.py", (*HEAVY, *WIRE, "gateway.ros", "gateway.rpc", "asyncio")),
        (
            "gateway/state.py",
            (*HEAVY, *WIRE, "asyncio", "gateway.ros", "gateway.rpc", "gateway.links", "gateway.metrics"),
        ),
        # What mends a part is its owner's; here it is only seen.
        ("gateway/health_reporter.py", (*HEAVY, *WIRE, "asyncio", "gateway.ros", "gateway.links")),
        ("gateway/access_control.py", (*HEAVY, "google.protobuf", "omniseer", "gateway.ros")),
        ("gateway/metrics/", (*HEAVY, *WIRE, "gateway.ros", "gateway.config")),
        ("gateway/doctor/", (*HEAVY, *WIRE, "gateway.rpc", "console")),
        ("gateway/rpc/", ("gateway.ros",)),
        ("gateway/links/", ("gateway.ros", "gateway.rpc", "omniseer.gateway")),
        ("gateway/links/reconciler.py", (*WIRE, "asyncio", "gateway.links.preview", "gateway.links.link")),
        ("gateway/links/link.py", (*WIRE, "gateway.links.preview", "gateway.links.grpc_client")),
        ("gateway/links/watch.py", (*WIRE, "gateway.links")),
        ("gateway/links/recorder/", ("gateway.links.preview", "gateway.links.drive", "gateway.links.link")),
        (
            "gateway/links/bridge/",
            ("gateway.links.preview", "gateway.links.drive", "gateway.links.link", "gateway.teleop"),
        ),
        ("gateway/links/bridge/requests.py", (*WIRE, "omniseer", "asyncio", "time", "gateway.links")),
        ("gateway/rpc/hub_requests.py", ("omniseer.bridge", "gateway.teleop", "gateway.access", "grpc")),
        ("gateway/links/drive/", ("gateway.teleop", "gateway.links.preview")),
        ("gateway/teleop/", (*HEAVY, *WIRE, "omniseer", "gateway.ros", "gateway.rpc", "gateway.config")),
        *(
            (f"gateway/teleop/{name}.py", ("asyncio", "time", "gateway.links"))
            for name in ("lease", "pacing")
        ),
        ("preview/state/", (*HEAVY, *WIRE, "asyncio")),
        ("preview/state/lifecycle.py", (*HEAVY, *WIRE, "asyncio", "preview")),
        ("preview/state/values.py", (*HEAVY, *WIRE, "asyncio", "preview.pipeline", "preview.encoders")),
        ("preview/config/", (*HEAVY, *WIRE, "asyncio", "preview.pipeline")),
        ("preview/encoders/", ("preview.pipeline", "preview.rpc", "preview.supervisor", "preview.config")),
        ("preview/pipeline/", ("preview.rpc", "preview.supervisor", "preview.app")),
        ("preview/supervisor/", (*HEAVY, *WIRE, "common.gst", "preview.pipeline.runner", "preview.rpc")),
        ("preview/state/cameras.py", (*HEAVY, *WIRE, "asyncio", "time", "preview")),
        ("preview/rpc/", ("common.gst",)),
        ("preview/tap.py", (*HEAVY, *WIRE, "common.gst", "omniseer", "preview.rpc", "preview.config")),
        ("common/export_connection.py", (*HEAVY, *WIRE, "common", "asyncio", "time", "socket")),
        ("gateway/links/recorder/export_connection.py", (*WIRE, "omniseer")),
        ("common/camera_tap.py", (*HEAVY, *WIRE, "common", "asyncio", "time", "socket")),
        *(
            (f"common/{name}.py", (*HEAVY, *WIRE, "omniseer"))
            for name in ("open_file", "paced_chunks", "reader_threads")
        ),
        ("recorder/rpc/export_connections.py", (*WIRE, "omniseer")),
        ("preview/pipeline/tap_client.py", (*HEAVY, *WIRE, "common.gst", "asyncio")),
        ("tap/", ("gi", "common.gst", "grpc", "google.protobuf", "omniseer")),
        *(
            (f"tap/{name}.py", (*HEAVY, "asyncio", "time", "socket", "tap.connection", "tap.camera"))
            for name in ("refusal", "cdr", "compressed", "image", "capture_time")
        ),
        ("tap/config.py", (*HEAVY, "asyncio", "tap")),
        ("common/video_tap.py", (*HEAVY, *WIRE, "common", "asyncio", "time")),
        *(
            (pure, (*HEAVY, *WIRE, "omniseer.drive", "drive.config", "drive.ros.base", "time"))
            for pure in ("drive/motion/", "drive/ros/outranking.py", "drive/processes/watch.py")
        ),
        ("drive/motion/", ("drive.config", "drive.endpoint", "drive.processes", "drive.ros")),
        ("drive/endpoint/", (*HEAVY, "drive.processes", "drive.ros")),
        ("drive/processes/", (*HEAVY, "drive.config", "drive.ros")),
        ("drive/ros/", ("drive.motion.machine", "drive.endpoint", "drive.processes")),
        *(
            (f"console/{name}.py", (*HEAVY, *WIRE, "asyncio", "typer", "rich", "console.client"))
            for name in ("target", "credentials")
        ),
        ("common/printable.py", (*HEAVY, *WIRE, "asyncio", "typer", "rich")),
        ("console/robots/", ("console.client",)),
        ("console/client/", (*HEAVY, "common.gst", "console.receiver")),
        ("console/presentation/", (*HEAVY, *WIRE, "common.gst", "typer", "rich", "console.cli")),
        ("console/robots/", (*HEAVY, *WIRE, "common.gst", "typer", "rich", "console.cli")),
        ("console/viewer/", (*HEAVY, *WIRE, "common.gst", "console.window", "console.cli")),
        (
            "console/monitor/",
            (
                *(*HEAVY, *WIRE, "common.gst"),
                *("console.receiver", "console.viewer", "console.window", "console.cli"),
            ),
        ),
        ("console/gamepad/", (*HEAVY, *WIRE, "asyncio", "console.window", "console.monitor", "console.cli")),
        *(
            (f"console/gamepad/{name}.py", ("sdl2", "ctypes", "time", "threading"))
            for name in ("shaping", "hands")
        ),
        ("console/steering.py", (*HEAVY, *WIRE, "asyncio", "time", "console")),
        ("console/window/", ("console.cli",)),
        ("console/receiver/", WIRE),
        *(
            (f"bridge/{name}.py", (*HEAVY, *WIRE, "omniseer", "asyncio", "time", "fleet"))
            for name in ("events/values", "connection/lifecycle", "commands/hub_time")
        ),
        ("bridge/robot/feed.py", ("grpc", "asyncio", "time", "fleet", "bridge.outbox")),
        ("bridge/connection/robot_state.py", ("grpc", "asyncio", "time", "fleet", "bridge.outbox")),
        ("bridge/outbox/", (*HEAVY, *WIRE, "omniseer", "fleet", "bridge.robot", "bridge.commands")),
        ("bridge/commands/judgement.py", ("grpc", "asyncio", "time", "fleet.connection", "bridge.outbox")),
    ],
)
def test_dependencies_point_inward(importer: str, forbidden: tuple[str, ...]) -> None:
    assert any(found.importer.startswith(importer) for found in imports()), f"nothing is left of {importer}"
    assert not offenders(importer, forbidden)


@pytest.mark.parametrize(
    ("library", "homes"),
    [
        (
            "rclpy",
            (
                "common/ros_node.py",
                "gateway/ros/",
                "drive/ros/base.py",
                "drive/ros/stop_input.py",
                "drive/ros/subscriptions.py",
                "drive/doctor",
                "recorder/intake/",
                "simrobot/",
                "tap/camera.py",
            ),
        ),
        ("gi", ("common/gst.py",)),
        ("PySide6", ("console/window/",)),
        ("sdl2", ("console/gamepad/sdl.py",)),
        ("mcap", ("recorder/mcap/",)),
        ("sqlite3", ("bridge/outbox/",)),
        (
            "prometheus_client",
            ("common/collector.py", "gateway/metrics/", "hub/", "bridge/", "tap/metrics.py"),
        ),
        ("zstandard", ("recorder/mcap/",)),
        ("psutil", ("gateway/platform",)),
        ("nats", ("fleet/nats_client.py",)),
        # Ours, but as close to the library: what is above a session knows neither.
        ("fleet.nats_client", ("fleet/session.py",)),
        ("nkeys", ("fleet/identity.py",)),
        ("nacl", ("fleet/receipts.py", "fleet/receipt_keys.py")),
        ("boto3", ("hub/receiver/",)),
        ("botocore", ("hub/receiver/",)),
        ("aiohttp", ("bridge/uploads/",)),
        ("cryptography", ("common/ca.py",)),
        ("yaml", ("common/config.py", "recorder/values/offered_qos.py", "recorder/mcap/rosbag2.py")),
        ("zeroconf", ("gateway/platform/advertiser.py", "console/robots/discovery.py")),
        ("google_crc32c", ("console/client/file_stream.py", "common/open_file.py")),
        ("tomlkit", ("console/robots/robots_file_edit.py",)),
        (
            "google.protobuf",
            (
                "common/interceptors.py",
                "common/refusal.py",
                "gateway/rpc/",
                "gateway/links/",
                "preview/rpc/",
                "drive/",
                "console/client/",
                "fleet/",
                "bridge/",
                "hub/",
            ),
        ),
        (
            "omniseer.gateway",
            (
                "gateway/rpc/",
                "console/client/",
                "practice/wire.py",
                "recorder/rpc/",
                "recorder/doctor/",
                "fleet/",
                "bridge/",
                "hub/receiver/",
                "hub/exporter/",
                "console/fleet/",
            ),
        ),
        ("omniseer.bridge", ("gateway/links/bridge/", "bridge/")),
        ("omniseer.fleet", ("fleet/", "bridge/", "hub/", "console/fleet/", "console/cli/fleet.py")),
        ("omniseer.preview", ("gateway/links/preview/", "preview/rpc/")),
        ("omniseer.drive", ("gateway/links/", "drive/")),
        ("omniseer.recorder", ("gateway/links/recorder/", "recorder/rpc/", "recorder/doctor/")),
    ],
)
def test_a_foreign_library_has_one_home(library: str, homes: tuple[str, ...]) -> None:
    strangers = [
        f"{found.importer}:{found.line}"
        for found in imports()
        if is_within(found.module, library) and not found.importer.startswith(homes)
    ]
    assert not strangers


def test_folders_do_not_import_each_other_in_circles() -> None:
    """The files at a program's root are one part, and each folder below it is another."""
    try:
        TopologicalSorter(imported_folders()).prepare()
    except CycleError as error:
        pytest.fail(" imports ".join(reversed(error.args[1])))


def test_the_rules_are_for_all_packages_of_the_product() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    packages = project["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]
    assert {each for each in packages if not each.startswith("proto/")} == set(OURS)


def imported_folders() -> dict[str, set[str]]:
    """The folders that the files of each folder import, but for itself."""
    imported: dict[str, set[str]] = {}
    for (importer, _), found in groupby(imports(), key=lambda found: (found.importer, found.line)):
        folder = str(Path(importer).parent)
        files = imported_files({each.module for each in found})
        imported.setdefault(folder, set()).update({str(Path(file).parent) for file in files} - {folder})
    return imported


def imported_files(modules: set[str]) -> Iterator[str]:
    """Our files that an import statement names; not the package in `from package import module`."""
    files = {}
    for module in modules:
        path = module.replace(".", "/")
        for file in (f"{path}.py", f"{path}/__init__.py"):
            if (ROOT / file).is_file():
                files[module] = file
    for module, file in files.items():
        if not any(is_within(other, module) for other in files.keys() - {module}):
            yield file


def test_the_fence_sees_what_it_should() -> None:
    """A fence that reads no imports would let everything through."""
    assert offenders("common/gst.py", ("gi",))
    assert len({found.importer for found in imports()}) > 20
    assert "gateway/status" in imported_folders()["gateway"]
    assert "console/client/results" in imported_folders()["console/client"]


def test_our_programs_take_the_names_of_their_nodes_from_one_list() -> None:
    """By it the drive program distinguishes an observer from a base."""
    calls = {
        ast.unparse(node.args[0])
        for program in PROGRAMS
        if program != "simrobot"
        for path in (ROOT / program).rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "ros_node"
    }
    assert calls
    assert all(name.startswith("OwnNode.") for name in calls)


def test_each_part_that_the_documents_table_names_exists() -> None:
    parts = list(documented_parts())
    assert len(parts) > 50
    assert not [each for each in parts if not ((ROOT / each).exists() or (ROOT / f"{each}.py").is_file())]


def documented_parts() -> Iterator[str]:
    """The paths of the table "Who knows what", each that braces stand for by itself."""
    text = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    table = text.partition("## Who knows what")[2].partition("\n## ")[0]
    for row in re.findall(r"^\| (`.+?) \|", table, re.MULTILINE):
        for path in re.findall(r"`([^`]+)`", row):
            before, _, rest = path.partition("{")
            names, _, after = rest.partition("}")
            yield from (f"{before}{name}{after}" for name in names.split(","))
