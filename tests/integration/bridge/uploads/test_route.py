"""The interface through which the store is reached: real routes, in a network namespace of the test's own."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from bridge.uploads.route import interface_to

ROOT = Path(__file__).parents[4]
ASK = (
    "import asyncio, json, sys; from bridge.uploads.route import interface_to; "
    "print(json.dumps([asyncio.run(interface_to(each)) for each in sys.argv[1:]]))"
)
PUT = """
import asyncio, json, sys
from bridge.config import UploadSettings
from bridge.uploads.parts import PartSender
from bridge.uploads.problems import CutError

async def nothing():
    yield b"x"

async def put(host):
    hosts = ("10.1.0.9:9000", "both:9000", "10.3.0.9:9000")
    async with PartSender(UploadSettings(store_hosts=hosts, interfaces=("wlan*",))) as sender:
        try:
            return await asyncio.wait_for(sender.put(f"https://{host}/part", 1, nothing()), 3)
        except CutError as error:
            return str(error)
        except TimeoutError:
            return "connecting"

print(json.dumps([asyncio.run(put(each)) for each in sys.argv[1:]]))
"""
Asking = Callable[..., list[str]]

needs_root = pytest.mark.skipif(
    os.geteuid() != 0 or shutil.which("ip") is None, reason="network namespaces need root"
)


def ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True, capture_output=True, text=True)


@pytest.fixture
def asking() -> Iterator[Asking]:
    """Asks in a namespace with two cables: wlan0 with two networks, and wwan0, the way to all others."""
    name = f"rg-route-{os.getpid()}"
    ip("netns", "add", name)
    try:
        for words in (
            ("link", "set", "lo", "up"),
            ("link", "add", "wlan0", "type", "veth", "peer", "name", "wlan0-far"),
            ("link", "set", "wlan0-far", "up"),
            ("address", "add", "10.1.0.2/24", "dev", "wlan0"),
            ("address", "add", "10.2.0.2/24", "dev", "wlan0"),
            ("address", "add", "fd01::2/64", "dev", "wlan0", "nodad"),
            ("link", "set", "wlan0", "up"),
            ("link", "add", "wwan0", "type", "veth", "peer", "name", "wwan0-far"),
            ("link", "set", "wwan0-far", "up"),
            # The same address as the other one: unnumbered interfaces are like that.
            ("address", "add", "10.1.0.2/32", "dev", "wwan0"),
            ("link", "set", "wwan0", "up"),
            ("route", "add", "10.3.0.0/24", "dev", "wwan0"),
            ("route", "add", "unreachable", "10.4.0.0/24"),
            ("-6", "route", "add", "unreachable", "fd04::/64"),
            ("route", "add", "10.5.0.0/24", "dev", "wlan0", "table", "7"),
            ("rule", "add", "to", "10.5.0.0/24", "lookup", "7"),
        ):
            ip("-n", name, *words)
        # Names without a name server; "both" has two addresses, of which the first has no route.
        hosts = Path("/etc/netns") / name / "hosts"
        hosts.parent.mkdir(parents=True)
        hosts.write_text("10.1.0.9 store\nfd01::9 six\nfd04::9 both\n10.3.0.9 both\n", encoding="ascii")

        def ask(*stores: str, program: str = ASK) -> list[str]:
            done = subprocess.run(
                ["ip", "netns", "exec", name, sys.executable, "-c", program, *stores],
                cwd=ROOT,
                capture_output=True,
                text=True,
                timeout=60,
                check=False,
            )
            assert done.returncode == 0, done.stderr
            found: list[str] = json.loads(done.stdout)
            return found

        try:
            yield ask
        finally:
            shutil.rmtree(hosts.parent)
    finally:
        ip("netns", "delete", name)


@needs_root
def test_the_route_decides_and_not_the_address_that_is_sent_from(asking: Asking) -> None:
    stores = ("10.1.0.9", "10.1.0.9:9000", "10.2.0.9", "10.3.0.9:9000", "10.5.0.9", "127.0.0.1:9000")
    assert asking(*stores) == ["wlan0", "wlan0", "wlan0", "wwan0", "wlan0", "lo"]


@needs_root
def test_the_robots_own_address_is_reached_within_it(asking: Asking) -> None:
    assert asking("10.2.0.2:9000", "10.1.0.2") == ["lo", "lo"]


@needs_root
def test_names_are_resolved_and_an_address_without_a_route_is_passed_over(asking: Asking) -> None:
    assert asking("store:9000", "six", "both:9000") == ["wlan0", "wlan0", "wwan0"]


@needs_root
def test_no_connection_is_made_through_an_interface_that_is_not_allowed(asking: Asking) -> None:
    allowed, *others = asking("10.1.0.9:9000", "10.3.0.9:9000", "both:9000", program=PUT)
    # The kernel, too, gives up after three seconds in which no neighbour has answered.
    assert allowed == "connecting" or "Connect call failed" in allowed
    for refused in others:
        assert "through wwan0; uploads are allowed through wlan*" in refused


@needs_root
def test_without_a_route_the_interface_is_not_known(asking: Asking) -> None:
    assert asking("10.4.0.9", "192.0.2.1", "10.4.0.9:9000") == ["", "", ""]


@needs_root
def test_an_interface_that_has_gone_down_is_not_named(asking: Asking) -> None:
    name = f"rg-route-{os.getpid()}"
    ip("-n", name, "link", "set", "wwan0", "down")
    assert asking("10.3.0.9", "10.1.0.9") == ["", "wlan0"]


@pytest.mark.parametrize("host", ["a..b", "x" * 70 + ".example", "no such name"])
async def test_a_name_that_is_none_has_no_interface(host: str) -> None:
    assert await interface_to(host) == ""
