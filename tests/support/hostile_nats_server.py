"""A server that greets as a NATS server does, and from then on says what a test has it say."""

from asyncio import IncompleteReadError, StreamReader, StreamWriter, start_server
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Final

INFO: Final = b'INFO {"server_id":"x","version":"2.10.0","max_payload":1048576,"headers":true}\r\n'


class HostileServer:
    """Answers every ping, and each published message with `answer`.

    Attributes:
        answer: makes the bytes of the subscription's number and the reply subject.
        info: the greeting.
        url: where it listens.
    """

    def __init__(self, answer: Callable[[bytes, bytes], bytes]) -> None:
        self.answer = answer
        self.info = INFO
        self.url = ""

    async def serve(self, reader: StreamReader, writer: StreamWriter) -> None:
        """Serves one connection."""
        number = b"1"
        try:
            writer.write(self.info)
            while line := await reader.readline():
                words = line.split()
                match words[0]:
                    case b"PING":
                        writer.write(b"PONG\r\n")
                    case b"SUB":
                        number = words[-1]
                    case b"PUB" | b"HPUB":
                        await reader.readexactly(int(words[-1]) + 2)
                        writer.write(self.answer(number, words[2]))
                        await writer.drain()
        except (ConnectionError, IncompleteReadError):
            return
        finally:
            writer.close()


@asynccontextmanager
async def hostile_server(answer: Callable[[bytes, bytes], bytes]) -> AsyncIterator[HostileServer]:
    """Serves while the block runs."""
    server = HostileServer(answer)
    async with await start_server(server.serve, "127.0.0.1", 0) as listening:
        server.url = f"nats://127.0.0.1:{listening.sockets[0].getsockname()[1]}"
        yield server
