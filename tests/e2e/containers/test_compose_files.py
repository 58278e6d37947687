"""What each overlay adds up to, as compose itself resolves it. Needs compose, no engine's work."""

import json
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml

from common import ros_transport
from tests.support.documented_configuration import THREE_CAMERAS, documented
from tests.support.engine import ROOT

pytestmark = pytest.mark.docker

OVERLAYS = ("", "rockchip", "v4l2", "vaapi", "demo", "guarded", "realtime")


def config(*overlays: str, profile: str = "", own: Path | None = None) -> dict[str, Any]:
    """What compose makes of the base with overlays, and with a file of the robot's own."""
    files = [f"compose.{name}.yaml" for name in overlays if name]
    return resolved("compose.yaml", *files, *([str(own)] if own else []), profile=profile)


def resolved(*files: str, profile: str) -> dict[str, Any]:
    words = [word for name in files for word in ("-f", name)]
    done = subprocess.run(
        ["docker", "compose", *words, "--profile", profile, "config", "--format", "json"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert not done.stderr, "compose warns of something"
    found: dict[str, Any] = json.loads(done.stdout)
    return found


@pytest.mark.parametrize("overlay", OVERLAYS)
def test_every_service_is_hardened_and_bounded_in_every_overlay(overlay: str) -> None:
    services = config(overlay, profile="*")["services"]
    for name, service in services.items():
        assert service["read_only"], name
        assert service["cap_drop"] == ["ALL"], name
        assert "no-new-privileges:true" in service["security_opt"], name
        assert not service.get("privileged"), name
        assert "cap_add" not in service, name
    for name in ("gateway", "preview", "drive", "recorder", "tap", "bridge"):
        assert services[name]["restart"] == "unless-stopped"
        log = services[name]["logging"]["options"]
        assert (log["max-size"], log["max-file"]) == ("10m", "3")
        assert log["mode"] == "non-blocking", "a disk that hangs would hold up the program"
        assert int(services[name]["mem_limit"]) <= 512 << 20
        assert services[name]["pids_limit"] <= 256


def test_real_time_priority_and_locked_memory_take_no_privilege() -> None:
    drive = config("realtime", profile="drive")["services"]["drive"]
    assert drive["ulimits"] == {"rtprio": 20, "memlock": -1}
    assert drive["oom_score_adj"] < 0


def test_the_camera_tap_is_off_unless_its_profile_is_asked_for() -> None:
    assert not {"tap", "tap-config"} & config()["services"].keys()
    services = config(profile="tap")["services"]
    tap, preview = services["tap"], services["preview"]
    assert tap["image"] == services["gateway"]["image"]
    assert tap["user"].partition(":")[2] == "10000", "the group of the preview"
    assert tap["network_mode"] == "host"
    assert "ipc" not in tap, "the topics come over UDP"
    assert tap["environment"]["TAP__SOCKET"] == preview["environment"]["PREVIEW__CAMERA_TAP__SOCKET"]
    link = next(each for each in preview["volumes"] if each["source"] == "tap-link")
    assert link["read_only"]


def test_driving_is_off_unless_its_profile_is_asked_for() -> None:
    assert not {"drive", "drive-config"} & config()["services"].keys()
    drive = config(profile="drive")["services"]["drive"]
    assert drive["cpu_shares"] > 1024


def test_recording_is_off_unless_its_profile_is_asked_for_and_yields_to_the_mission() -> None:
    assert not {"recorder", "recorder-config"} & config()["services"].keys()
    recorder = config(profile="record")["services"]["recorder"]
    assert recorder["cpu_shares"] < 1024
    assert recorder["oom_score_adj"] > 0


def test_the_fleet_is_off_unless_its_profile_is_asked_for_and_yields_to_the_mission() -> None:
    assert not {"bridge", "bridge-config"} & config()["services"].keys()
    bridge = config(profile="bridge")["services"]["bridge"]
    assert bridge["cpu_shares"] < 1024
    assert bridge["oom_score_adj"] > 0
    assert bridge["network_mode"] == "host", "the gateway's loopback, and the robot's own interfaces"
    assert not {"ports", "devices", "ipc", "privileged"} & bridge.keys()


def test_the_bridge_can_not_change_who_it_is() -> None:
    services = config("guarded", profile="bridge")["services"]
    for name in ("bridge", "bridge-config"):
        mounts = {each["target"]: each for each in services[name]["volumes"]}
        assert mounts["/etc/robot-bridge"]["read_only"]
        assert mounts["/etc/robot-gateway/bridge.yaml"]["read_only"]
        assert not mounts["/etc/robot-bridge"]["bind"].get("create_host_path")
        environment = services[name]["environment"]
        assert environment["BRIDGE__GATEWAY__LOGIN"] == "/etc/robot-bridge/gateway.login"


@pytest.mark.parametrize("overlay", [each for each in OVERLAYS if each != "demo"])
def test_the_gateway_hears_its_own_machines_graph_alone(overlay: str) -> None:
    """The demo's containers are machines to each other, on a network of their own."""
    environment = config(overlay)["services"]["gateway"]["environment"]
    assert environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"


@pytest.mark.parametrize("overlay", OVERLAYS)
def test_no_caller_keeps_the_gateways_health_check_out(overlay: str) -> None:
    """It asks where none of them calls, in a directory that is the gateway's alone."""
    gateway = config(overlay)["services"]["gateway"]
    socket = Path(gateway["environment"]["GATEWAY__GRPC__SOCKET"])
    assert gateway["environment"]["HEALTH_TARGET"] == f"unix:{socket}"
    (options,) = (each.partition(":")[2] for each in gateway["tmpfs"] if each.startswith(f"{socket.parent}:"))
    assert {"mode=0700", "uid=10001"} <= set(options.split(","))


def test_video_yields_to_the_mission() -> None:
    services = config()["services"]
    assert services["preview"]["cpu_shares"] < 1024
    assert services["preview"]["oom_score_adj"] > services["gateway"].get("oom_score_adj", 0)


def test_a_guarded_gateway_reads_credentials_that_it_can_not_change() -> None:
    services = config("guarded")["services"]
    for name in ("gateway", "gateway-config"):
        environment = services[name]["environment"]
        assert environment["GATEWAY__SECURITY__CREDENTIALS"] == "/var/lib/robot-gateway/credentials"
    mounts = {each["target"]: each for each in services["gateway"]["volumes"]}
    assert mounts["/var/lib/robot-gateway/credentials"]["read_only"]
    assert not mounts["/var/lib/robot-gateway/audit"].get("read_only")
    assert "credentials" not in services, "it runs when the robot's keeper asks for it, never by itself"


def test_what_a_robot_without_credentials_accepted_ends_with_the_overlay() -> None:
    """In whatever order the files are named."""
    for order in (("demo", "guarded"), ("guarded",)):
        assert config(*order)["services"]["gateway"]["environment"]["GATEWAY__SECURITY__INSECURE"] == "false"


@pytest.mark.parametrize(
    ("program", "profile"), [("gateway", ""), ("drive", "drive"), ("recorder", "record"), ("tap", "tap")]
)
def test_what_speaks_ros_is_where_the_robots_nodes_are(program: str, profile: str) -> None:
    """And shares no memory with them: they are other users (gateway/ros/test_other_users.py)."""
    service = config(profile=profile)["services"][program]
    assert service["network_mode"] == "host"
    assert "ipc" not in service
    assert {"ROS_DOMAIN_ID", "RMW_IMPLEMENTATION"} <= service["environment"].keys()
    assert service["environment"][ros_transport.VARIABLE] == "udp"


@pytest.mark.parametrize("program", ["gateway", "drive", "recorder", "tap"])
def test_the_demo_carries_ros_as_a_robot_does(program: str) -> None:
    services = config("demo", profile="*")["services"]
    assert services[program]["environment"][ros_transport.VARIABLE] == "udp"


@pytest.mark.parametrize("overlay", ["", "rockchip", "v4l2", "vaapi"])
def test_the_preview_publishes_one_udp_port_and_reaches_nothing(overlay: str) -> None:
    whole = config(overlay)
    preview = whole["services"]["preview"]
    assert [(port["protocol"], port["target"]) for port in preview["ports"]] == [("udp", 7100)]
    assert list(preview["networks"]) == ["viewers"]
    options = whole["networks"]["viewers"]["driver_opts"]
    assert options["com.docker.network.bridge.enable_ip_masquerade"] == "false"


@pytest.mark.parametrize("overlay", OVERLAYS)
@pytest.mark.parametrize("bind", ["", "127.0.0.1", "10.0.0.5", "[::1]"])
def test_the_preview_knows_where_its_port_is_published(
    overlay: str, bind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The gateway decides by it whether the stream is encrypted."""
    monkeypatch.setenv("PREVIEW_BIND", bind)
    services = config(overlay)["services"]
    (port,) = services["preview"]["ports"]
    address = services["preview"]["environment"]["PREVIEW__SRT__PUBLISHED_ON"]
    assert address.strip("[]") == port["host_ip"]


@pytest.mark.parametrize(
    ("overlay", "devices", "groups"),
    [
        (
            "rockchip",
            ["/dev/mpp_service", "/dev/rga", "/dev/dma_heap", "/dev/dri", "/dev/video11"],
            ["44", "105"],
        ),
        ("v4l2", ["/dev/video0"], ["44"]),
        ("vaapi", ["/dev/dri/renderD128"], ["105"]),
    ],
)
def test_devices_are_named_one_by_one(overlay: str, devices: list[str], groups: list[str]) -> None:
    preview = config(overlay)["services"]["preview"]
    assert passed_in(preview) == {device: device for device in devices}
    assert preview["group_add"] == groups


def passed_in(service: dict[str, Any]) -> dict[str, str]:
    """The devices of a service: their names outside, and inside."""
    return {device["source"]: device["target"] for device in service["devices"]}


BY_PATH = "/dev/v4l/by-path/pci-0000:00:14.0-usb-0:1:1.0-video-index0"


@pytest.mark.parametrize("camera", ["/dev/video2", BY_PATH])
@pytest.mark.parametrize("overlay", ["v4l2", "rockchip"])
def test_a_camera_has_its_own_name_in_the_container(
    overlay: str, camera: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By another name the node of a card would not be found."""
    monkeypatch.setenv("CAMERA", camera)
    preview = config(overlay)["services"]["preview"]
    assert passed_in(preview)[camera] == camera
    assert preview["environment"]["PREVIEW__SOURCE__DEVICE"] == camera


@pytest.mark.parametrize(
    "overlays", [(), ("vaapi",), ("rockchip",)], ids=lambda names: "+".join(names) or "none"
)
def test_the_documented_overlay_passes_in_the_documented_cameras(
    overlays: tuple[str, ...], tmp_path: Path
) -> None:
    cameras = yaml.safe_load(documented("cameras", THREE_CAMERAS))["cameras"].values()
    wanted = [camera["device"] for camera in cameras if camera["kind"] == "v4l2"]
    assert len(wanted) == 2
    overlay = yaml.safe_load(documented("services", THREE_CAMERAS))
    if "rockchip" in overlays:
        # As the page says.
        del overlay["services"]["preview"]["group_add"]
    own = tmp_path / "compose.cameras.yaml"
    own.write_text(yaml.safe_dump(overlay), encoding="utf-8")
    before = config(*overlays)["services"]["preview"]
    preview = config(*overlays, own=own)["services"]["preview"]
    others = passed_in(before) if overlays else {}
    assert passed_in(preview) == others | {device: device for device in wanted}
    assert "44" in preview["group_add"]
    assert preview["read_only"]


def test_overlays_of_camera_and_encoder_add_up() -> None:
    preview = config("v4l2", "vaapi")["services"]["preview"]
    assert len(preview["devices"]) == 2
    assert preview["group_add"] == ["44", "105"]
    assert preview["build"]["args"]["EXTRA_PACKAGES"].split() == ["intel-media-va-driver", "mesa-va-drivers"]


def test_the_demo_is_published_to_this_machine_alone() -> None:
    services = config("demo")["services"]
    ports = [port for service in services.values() for port in service.get("ports", [])]
    assert len(ports) == 2
    assert all(port["host_ip"] == "127.0.0.1" for port in ports)
    assert "network_mode" not in services["gateway"]


def test_nodes_of_a_hub_on_one_machine_ask_for_no_port_twice() -> None:
    services = resolved("deploy/hub/compose.three.yaml", profile="*")["services"]
    published = {name: service.get("ports", []) for name, service in services.items()}
    assert [name for name, ports in published.items() if ports] == ["exporter"]
    assert [port["host_ip"] for port in published["exporter"]] == ["127.0.0.1"]
    data = [services[name]["volumes"][1]["source"] for name in ("n1", "n2", "n3")]
    assert len(set(data)) == 3


@pytest.mark.parametrize("file", ["compose.yaml", "compose.three.yaml"])
def test_every_service_of_a_hub_is_hardened_and_fetches_nothing(file: str) -> None:
    for name, service in resolved(f"deploy/hub/{file}", profile="*")["services"].items():
        assert service["read_only"], name
        assert service["cap_drop"] == ["ALL"], name
        assert "no-new-privileges:true" in service["security_opt"], name
        assert service["pull_policy"] == "never", name
        if name != "admin":  # which ends by itself
            assert service["logging"]["options"]["mode"] == "non-blocking", name
        # The administration's own, which changes the servers' files.
        assert ("cap_add" in service) == (name == "admin"), name
