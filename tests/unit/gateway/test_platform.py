"""Machines that this one is not, as trees of small files."""

from pathlib import Path

import pytest

from gateway.config import PlatformSettings
from gateway.platform import battery, compute, network
from gateway.platform.sampler import PlatformSampler
from gateway.status.board import Board
from gateway.status.sources import COMPUTE, NETWORK
from gateway.status.values import Battery
from tests.support.waiting import wait_until


def tree(root: Path, files: dict[str, str]) -> Path:
    for name, content in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content + "\n")
    return root


def test_the_hottest_processor_sensor_counts(tmp_path: Path) -> None:
    rk3588 = tree(
        tmp_path,
        {
            "class/thermal/thermal_zone0/type": "soc-thermal",
            "class/thermal/thermal_zone0/temp": "61300",
            "class/thermal/thermal_zone1/type": "bigcore0-thermal",
            "class/thermal/thermal_zone1/temp": "64700",
            "class/thermal/thermal_zone2/type": "gpu-thermal",
            "class/thermal/thermal_zone2/temp": "90000",
            "class/hwmon/hwmon0/name": "nvme",
            "class/hwmon/hwmon0/temp1_input": "99000",
        },
    )
    assert compute.temperature_c(rk3588) == 64.7


def test_a_processors_own_monitor_will_do_and_nonsense_is_left_out(tmp_path: Path) -> None:
    pc = tree(
        tmp_path,
        {
            "class/hwmon/hwmon0/name": "k10temp",
            "class/hwmon/hwmon0/temp1_input": "48250",
            "class/hwmon/hwmon0/temp2_input": "-274000",
            "class/thermal/thermal_zone0/type": "cpu-thermal",
            "class/thermal/thermal_zone0/temp": "not a number",
        },
    )
    assert compute.temperature_c(pc) == 48.25
    assert compute.temperature_c(tmp_path / "nothing") is None


@pytest.mark.parametrize(("state", "expected"), [("0", False), ("3", True)])
def test_a_processor_that_is_clocked_down_is_throttled(tmp_path: Path, state: str, expected: bool) -> None:
    machine = tree(
        tmp_path,
        {
            "class/thermal/cooling_device0/type": "pwm-fan",
            "class/thermal/cooling_device0/cur_state": "4",
            "class/thermal/cooling_device1/type": "thermal-cpufreq-0",
            "class/thermal/cooling_device1/cur_state": state,
        },
    )
    assert compute.throttled(machine) is expected


@pytest.mark.parametrize(("bits", "expected"), [("0", False), ("50000", False), ("e0008", True), ("4", True)])
def test_a_raspberry_pis_firmware_reports_what_is_now_not_what_was(
    tmp_path: Path, bits: str, expected: bool
) -> None:
    pi = tree(tmp_path, {"devices/platform/soc/soc:firmware/get_throttled": bits})
    assert compute.throttled(pi) is expected


def test_a_machine_that_does_not_report_it_is_not_said_to_be_cool(tmp_path: Path) -> None:
    fan = {"class/thermal/cooling_device0/type": "pwm-fan", "class/thermal/cooling_device0/cur_state": "4"}
    assert compute.throttled(tree(tmp_path, fan)) is None


def test_this_machine_has_plausible_figures() -> None:
    value = compute.read(Path("/"))
    assert 0 < value.ram_used_bytes < value.ram_total_bytes
    assert 0 < value.ram_used_percent < 100
    assert value.disk_used_percent is not None
    assert 0 <= value.disk_used_percent <= 100
    assert compute.read(Path("/nonexistent")).disk_used_percent is None


ROUTES = """Iface\tDestination\tGateway \tFlags\tRefCnt\tUse\tMetric\tMask\t\tMTU\tWindow\tIRTT
eth0\t000200C0\t00000000\t0001\t0\t0\t0\t00FFFFFF\t0\t0\t0
wlan0\t00000000\t010200C0\t0003\t0\t0\t600\t00000000\t0\t0\t0
eth0\t00000000\t010200C0\t0003\t0\t0\t100\t00000000\t0\t0\t0"""
WIRELESS = """Inter-| sta-|   Quality        |   Discarded packets               | Missed | WE
 face | tus | link level noise |  nwid  crypt   frag  retry   misc | beacon | 22
 wlan0: 0000   49.  -61.  -256        0      0      0      0      0        0"""


def test_the_way_out_is_the_default_route_with_the_smallest_metric(tmp_path: Path) -> None:
    assert network.default_interface(tree(tmp_path, {"net/route": ROUTES})) == "eth0"
    assert network.default_interface(tmp_path / "nothing") is None


ROUTES_6 = f"""{"0" * 32} 00 {"0" * 32} 00 {"0" * 32} ffffffff 00000001 00000000 00200200 lo
{"0" * 32} 00 {"0" * 32} 00 fe80{"0" * 27}1 00000400 00000001 00000000 00000003 wlan0
{"0" * 32} 00 {"0" * 32} 00 fe80{"0" * 27}1 00000064 00000001 00000000 00000003 eth1
fe80{"0" * 28} 40 {"0" * 32} 00 {"0" * 32} 00000001 00000001 00000000 00000001 eth0"""


def test_a_network_without_ipv4_has_a_way_out_as_well(tmp_path: Path) -> None:
    proc = tree(tmp_path, {"net/route": ROUTES.splitlines()[0], "net/ipv6_route": ROUTES_6})
    assert network.default_interface(proc) == "eth1"
    assert network.default_interface(tree(tmp_path, {"net/route": ROUTES})) == "eth0", "IPv4 goes first"


def test_an_interface_that_lost_its_network_has_no_signal(tmp_path: Path) -> None:
    lost = WIRELESS.replace("49.  -61.", " 0.  -256.")
    assert network.wireless("wlan0", tree(tmp_path, {"net/wireless": lost})) == (0, None)


def test_a_wireless_interface_reports_signal_and_quality(tmp_path: Path) -> None:
    proc = tree(tmp_path, {"net/wireless": WIRELESS})
    assert network.wireless("wlan0", proc) == (70, -61)
    assert network.wireless("wlan01", proc) == (None, None)
    assert network.wireless("wlan0", tmp_path / "nothing") == (None, None)


def test_the_loopback_is_up_and_has_an_address_and_a_missing_interface_has_not() -> None:
    assert network.read("lo").connected
    assert not network.read("no-such-interface").connected


def test_a_machine_without_a_way_out_is_not_connected(tmp_path: Path) -> None:
    value = network.read(None, tmp_path)
    assert (value.interface_name, value.connected) == ("", False)


def test_the_computers_battery_is_found_among_other_supplies(tmp_path: Path) -> None:
    laptop = tree(
        tmp_path,
        {
            "class/power_supply/AC/type": "Mains",
            "class/power_supply/A_mouse/type": "Battery",
            "class/power_supply/A_mouse/scope": "Device",
            "class/power_supply/BAT0/type": "Battery",
            "class/power_supply/BAT0/present": "1",
            "class/power_supply/BAT0/voltage_now": "12345000",
            "class/power_supply/BAT0/capacity": "81",
            "class/power_supply/BAT0/status": "Discharging",
        },
    )
    assert battery.read(laptop) == Battery(True, 12.345, 81.0, False)
    assert battery.read(tmp_path / "nothing") is None


def test_a_battery_that_reports_little_is_not_made_up(tmp_path: Path) -> None:
    mute = {"class/power_supply/BAT0/type": "Battery", "class/power_supply/BAT0/status": "Unknown"}
    assert battery.read(tree(tmp_path, mute)) == Battery(True, None, None, None)


def test_the_sampler_renews_the_values_and_ends() -> None:
    board = Board()
    sampler = PlatformSampler(PlatformSettings(interval_ms=100), board)
    with sampler:
        first = wait_until(lambda: board[COMPUTE], "a first sample")
        wait_until(lambda: board[COMPUTE] is not first, "a second sample")
    assert board[NETWORK] is not None
