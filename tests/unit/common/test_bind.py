"""What a person reads when an address can't be bound."""

import os
import socket
import stat
from collections.abc import AsyncIterator
from pathlib import Path

import pytest
from grpc.aio import Server

from common.bind import bind_tcp, bind_unix
from common.errors import UserError
from common.rpc import new_server


@pytest.fixture
async def server() -> AsyncIterator[Server]:
    server = new_server()
    yield server
    # gRPC closes the ports of a server only if it was started.
    await server.start()
    await server.stop(None)


async def test_any_free_port_is_returned(server: Server) -> None:
    assert bind_tcp(server, "127.0.0.1", 0) > 0


async def test_a_taken_port_is_named_and_how_to_find_its_owner(server: Server) -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        with pytest.raises(UserError, match=rf"port {port} on 127\.0\.0\.1 is taken.*ss -ltnp"):
            bind_tcp(server, "127.0.0.1", port)


async def test_a_second_server_does_not_share_the_port() -> None:
    first = new_server()
    port = bind_tcp(first, "127.0.0.1", 0)
    await first.start()
    try:
        with pytest.raises(UserError, match="is taken"):
            bind_tcp(new_server(), "127.0.0.1", port)
    finally:
        await first.stop(None)


@pytest.mark.parametrize(
    ("host", "words"),
    [("192.0.2.77", "not an address of this machine"), ("no-such-host.invalid", "not an address or a known")],
)
async def test_an_address_of_another_host_is_reported_as_one(server: Server, host: str, words: str) -> None:
    with pytest.raises(UserError, match=words):
        bind_tcp(server, host, 0)


async def test_a_socket_is_for_user_and_group(server: Server, tmp_path: Path) -> None:
    path = tmp_path / "it.sock"
    bind_unix(server, path)
    assert stat.S_IMODE(path.stat().st_mode) == 0o660


async def test_what_a_dead_server_left_behind_is_replaced(server: Server, tmp_path: Path) -> None:
    path = tmp_path / "it.sock"
    with socket.socket(socket.AF_UNIX) as dead:
        dead.bind(str(path))
    bind_unix(server, path)


async def test_a_living_server_is_left_alone(server: Server, tmp_path: Path) -> None:
    path = tmp_path / "it.sock"
    with socket.socket(socket.AF_UNIX) as living:
        living.bind(str(path))
        living.listen()
        inode = path.stat().st_ino
        with pytest.raises(UserError, match="served by another program"):
            bind_unix(server, path)
        assert path.stat().st_ino == inode


async def test_a_file_is_not_overwritten(server: Server, tmp_path: Path) -> None:
    path = tmp_path / "notes.txt"
    path.write_text("mine")
    with pytest.raises(UserError, match="not a socket"):
        bind_unix(server, path)
    assert path.read_text() == "mine"


async def test_a_missing_directory_is_named(server: Server, tmp_path: Path) -> None:
    with pytest.raises(UserError, match="nowhere must be a directory that this user may write to"):
        bind_unix(server, tmp_path / "nowhere" / "it.sock")


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
async def test_a_directory_without_the_right_to_write_is_named(server: Server, tmp_path: Path) -> None:
    closed = tmp_path / "closed"
    closed.mkdir(mode=0o500)
    with pytest.raises(UserError, match="Permission denied"):
        bind_unix(server, closed / "it.sock")


async def test_a_path_that_linux_can_not_take_is_measured(server: Server, tmp_path: Path) -> None:
    with pytest.raises(UserError, match="Linux takes 107"):
        bind_unix(server, tmp_path / ("x" * 120))
