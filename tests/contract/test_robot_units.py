"""The units of a robot without Docker: judged by systemd's own tools, and compared with the containers."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[2]
DEPLOY = ROOT / "deploy/robot"
PROGRAMS = ("gateway", "preview", "drive", "recorder", "bridge", "tap")
MOST_EXPOSED = 2.5
"""Of 10, by systemd-analyze security: what may be exposed to one who takes over a program."""
OWN_SECTION = {
    "gateway": ["SystemCallFilter=sched_setscheduler setpriority"],
    "preview": ["SystemCallFilter=setpriority"],
    "drive": ["SystemCallFilter=sched_setscheduler"],
    "recorder": ["UMask=0027", "SystemCallFilter=setpriority ioprio_set sched_setscheduler"],
    "bridge": [],
    "tap": ["SystemCallFilter=sched_setscheduler"],
}
"""Beyond the hardening of all: priorities, and recordings that a group may read."""


DEVICES = {
    "preview": [
        "char-video4linux rw",
        "char-media rw",
        "char-drm rw",
        "char-dma_heap rw",
        "/dev/mpp_service rw",
        "/dev/rga rw",
    ]
}
"""The devices of each program, beyond null, zero, random and their like; no other program has any."""
CLASSES = {"/dev/video": "char-video4linux", "/dev/dri": "char-drm", "/dev/dma_heap": "char-dma_heap"}
"""Devices of the compose overlays, by the beginning of their names, as systemd names them."""


def text_of(program: str) -> str:
    return (DEPLOY / f"systemd/robot-{program}.service").read_text(encoding="utf-8")


def settings(program: str) -> dict[str, list[str]]:
    """The settings of a unit by name, each with all its values."""
    found: dict[str, list[str]] = {}
    for line in text_of(program).splitlines():
        name, is_setting, value = line.partition("=")
        if is_setting and not line.startswith("#"):
            found.setdefault(name, []).append(value)
    return found


def environment(name: str) -> dict[str, str]:
    lines = (DEPLOY / f"environment/{name}.env").read_text(encoding="utf-8").splitlines()
    return dict(line.split("=", 1) for line in lines)


def analyze(*arguments: str | Path) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        ["systemd-analyze", *arguments], capture_output=True, text=True, timeout=60, check=False
    )


@pytest.mark.parametrize("program", PROGRAMS)
def test_its_exposure_is_small(program: str) -> None:
    unit = DEPLOY / f"systemd/robot-{program}.service"
    judged = analyze("security", "--offline=yes", f"--threshold={round(MOST_EXPOSED * 10)}", unit)
    assert judged.returncode == 0, judged.stdout[-2000:]
    level = re.search(r"exposure level for robot-\w+\.service: ([\d.]+)", judged.stdout)
    assert level
    assert float(level[1]) <= MOST_EXPOSED


@pytest.mark.parametrize("program", PROGRAMS)
def test_systemd_reads_every_line_of_it(program: str, tmp_path: Path) -> None:
    # The programs are not installed here.
    unit = tmp_path / f"robot-{program}.service"
    unit.write_text(re.sub(r"^ExecStart=\S+", "ExecStart=/bin/true", text_of(program), flags=re.MULTILINE))
    verified = analyze("verify", "--man=no", "--recursive-errors=no", unit)
    assert (verified.returncode, verified.stderr) == (0, "")


def test_verify_would_notice_a_line_that_systemd_does_not_know(tmp_path: Path) -> None:
    unit = tmp_path / "robot-drive.service"
    unit.write_text("[Service]\nExecStart=/bin/true\nProtectSystemm=strict\n")
    assert "ProtectSystemm" in analyze("verify", "--man=no", "--recursive-errors=no", unit).stderr


def hardening(program: str) -> list[str]:
    section = text_of(program).partition("\n# Hardening, ")[2].partition("\n[Install]")[0]
    return [line for line in section.splitlines()[1:] if line and not line.startswith("#")]


@pytest.mark.parametrize("program", PROGRAMS)
def test_all_are_hardened_alike(program: str) -> None:
    # The bridge's is the whole of it.
    common, own = hardening("bridge"), hardening(program)
    assert len(common) > 20
    assert [line for line in own if line not in common] == OWN_SECTION[program]
    replaced = {line.partition("=")[0] for line in common if line not in own}
    assert replaced <= {line.partition("=")[0] for line in OWN_SECTION[program]}


@pytest.mark.parametrize("program", PROGRAMS)
def test_each_is_watched_and_started_again(program: str) -> None:
    found = settings(program)
    assert found["Type"] == ["notify"]
    assert found["WatchdogSec"] == ["10"]
    assert found["Restart"] == ["always"]
    assert found["StartLimitIntervalSec"] == ["0"]
    assert found["RestartPreventExitStatus"] == ["2"]


@pytest.mark.parametrize("program", PROGRAMS)
def test_each_has_a_user_of_its_own(program: str) -> None:
    assert settings(program)["User"] == [f"robot-{program}"]
    accounts = (DEPLOY / "sysusers.conf").read_text(encoding="utf-8")
    assert re.search(rf"^u robot-{program} ", accounts, re.MULTILINE)


@pytest.mark.parametrize("program", PROGRAMS)
def test_where_it_may_write_is_made_by_systemd(program: str) -> None:
    made = (DEPLOY / "tmpfiles.conf").read_text(encoding="utf-8")
    for paths in settings(program).get("ReadWritePaths", []):
        for path in paths.split():
            assert re.search(rf"^d {path} [02]750 robot-{program} ", made, re.MULTILINE)


@pytest.mark.parametrize("program", PROGRAMS)
def test_it_may_open_these_devices_and_no_others(program: str) -> None:
    found = settings(program)
    assert found["DevicePolicy"] == ["closed"]
    assert found.get("DeviceAllow", []) == DEVICES.get(program, [])
    assert found.get("PrivateDevices", []) == ([] if program in DEVICES else ["yes"])


def overlay_devices() -> set[str]:
    """The preview's devices in all compose overlays, as systemd names them."""
    found = set()
    for file in ROOT.glob("compose.*.yaml"):
        # Its tags are compose's own.
        text = file.read_text(encoding="utf-8").replace("!reset", "").replace("!override", "")
        for device in yaml.safe_load(text)["services"].get("preview", {}).get("devices", []):
            path = default_of(device["source"] if isinstance(device, dict) else device)
            named = [name for beginning, name in CLASSES.items() if path.startswith(beginning)]
            found.add(named[0] if named else path)
    return found


def test_the_previews_devices_are_those_of_the_containers() -> None:
    """And those of media controllers, which cameras on a board's own interface are set up by."""
    allowed = {each.removesuffix(" rw") for each in settings("preview")["DeviceAllow"]}
    assert allowed == overlay_devices() | {"char-media"}


def compose(program: str) -> dict[str, object]:
    service: dict[str, object] = yaml.safe_load((ROOT / "compose.yaml").read_text())["services"][program]
    return service


def default_of(value: object) -> str:
    """Of a compose value such as ${NAME:-default}."""
    return re.sub(r"\$\{\w+:-([^}]*)\}", r"\1", str(value))


@pytest.mark.parametrize("program", ["gateway", "preview", "drive", "recorder", "tap"])
def test_its_bounds_are_those_of_the_container(program: str) -> None:
    unit, container = settings(program), compose(program)
    assert unit["MemoryMax"] == [default_of(container["mem_limit"]).upper()]
    assert unit["CPUQuota"] == [f"{float(default_of(container['cpus'])):.0%}"]
    assert unit["TasksMax"] == [default_of(container["pids_limit"])]
    assert unit["TimeoutStopSec"] == [str(container["stop_grace_period"]).removesuffix("s")]
    if "cpu_shares" in container:
        # 1024 shares are the usual weight, 100 the usual CPUWeight.
        assert unit["CPUWeight"] == [str(int(str(container["cpu_shares"])) * 100 // 1024)]
    if "oom_score_adj" in container:
        assert unit["OOMScoreAdjust"] == [str(container["oom_score_adj"])]


@pytest.mark.parametrize("program", ["gateway", "preview", "drive", "recorder", "tap"])
def test_paths_and_sockets_are_those_of_the_container(program: str) -> None:
    file = "preview" if program == "preview" else "gateway"
    dockerfile = (ROOT / f"docker/{file}.Dockerfile").read_text(encoding="utf-8")
    variables = dict(re.findall(r"([A-Z_]+)=(/[^\s\\]+)", dockerfile))
    variables |= {name: str(value) for name, value in dict(compose(program).get("environment", {})).items()}  # type: ignore[call-overload]
    own = environment(program)
    paths = {name: value for name, value in own.items() if value.startswith("/")}
    assert paths
    assert {name: variables.get(name) for name in paths} == paths
    assert f"--config {own[f'ROBOT_{program.upper()}_CONFIG']}" in settings(program)["ExecStart"][0]


def test_the_graph_is_that_of_the_containers() -> None:
    anchors = yaml.safe_load((ROOT / "compose.yaml").read_text())["x-ros-environment"]
    assert environment("ros") == {name: default_of(value) for name, value in anchors.items()}


@pytest.mark.parametrize("program", PROGRAMS)
def test_what_is_installed_first_is_accepted_by_the_program(program: str, tmp_path: Path) -> None:
    """The files that `scripts/install-robot` gives a release, and its own check of them."""
    script = (ROOT / "scripts/install-robot").read_text(encoding="utf-8")
    copying = re.search(r"^share_files\(\) \{.*?^\}$", script, re.MULTILINE | re.DOTALL)
    assert copying
    command = f'set -eu; {copying[0]}; share_files "$1"'
    subprocess.run(["bash", "-c", command, "bash", tmp_path], cwd=ROOT, timeout=60, check=True)
    config = tmp_path / f"{program}.yaml"
    own = DEPLOY / config.name
    if own.exists():
        assert config.read_text(encoding="utf-8") == own.read_text(encoding="utf-8")
    module = f"from {program}.cli import main; main()"
    checked = subprocess.run(
        [sys.executable, "-c", module, "check", "--config", config],
        cwd=ROOT,
        env={**os.environ, **environment("ros"), **environment(program)},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert (checked.returncode, checked.stderr) == (0, "")


def test_the_gateway_may_connect_to_the_sockets_of_all_that_serve_it() -> None:
    accounts = (DEPLOY / "sysusers.conf").read_text(encoding="utf-8")
    members = set(re.findall(r"^m robot-gateway (\S+)$", accounts, re.MULTILINE))
    assert members == {f"robot-{program}" for program in PROGRAMS if program not in {"gateway", "tap"}}
    assert re.search(r"^m robot-preview robot-tap$", accounts, re.MULTILINE)


def test_the_list_of_packages_has_what_the_installer_looks_for() -> None:
    """`scripts/install-robot` looks for elements, and names these packages."""
    packages = (ROOT / "requirements/debian-robot.txt").read_text(encoding="utf-8")
    script = (ROOT / "scripts/install-robot").read_text(encoding="utf-8")
    looked_for = re.search(r'needed = "([^"]+)"', script)
    assert looked_for
    assert [name for name in looked_for[1].split() if name not in packages] == []
