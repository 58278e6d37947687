"""The gRPC channel of a client: methods in, results or `GatewayError`s out. Belongs to one asyncio loop."""

import asyncio
from typing import Any, Final, Generic, TypeVar

import grpc
from google.protobuf.message import DecodeError

from console.client.error_table import error_from
from console.client.errors import Cancelled, DeadlineExceeded, GatewayError, GatewayFailed, Unreachable
from console.client.mapping.methods import Method
from console.client.options import ClientOptions
from console.credentials import Credentials

ResultT = TypeVar("ResultT")

_MOST_WAITING: Final = 64
"""Unread items of a lossless stream; from there on HTTP/2 flow control holds the gateway back."""


class GrpcTransport:
    """One channel. It connects at the first call and reconnects whenever the connection breaks.

    Args:
        target: HOST:PORT of the gateway.
        options: Keepalive and connection deadlines.
        credentials: Sent with every call.

    Raises:
        UserError: The credentials would be sent in the clear.
    """

    def __init__(self, target: str, options: ClientOptions, credentials: Credentials) -> None:
        self._target = target
        self._metadata = (*credentials.metadata(), *options.metadata)
        arguments = options.channel_options()
        self._channel = (
            grpc.aio.secure_channel(target, _tls(credentials), options=arguments)
            if credentials.encrypts(target)
            else grpc.aio.insecure_channel(target, options=arguments)
        )
        self._closed = asyncio.Event()

    async def call(self, method: Method[ResultT], request: bytes, timeout_s: float) -> ResultT:
        """Returns the result of one attempt at a unary call.

        Raises:
            GatewayError: The attempt failed, or the client is closed.
        """
        self.check_open()
        try:
            attempt: Any = self._channel.unary_unary(method.path)
            answer = await attempt(request, timeout=timeout_s, metadata=self._metadata)
        except grpc.RpcError as failure:
            raise error_from(failure, self._target, timeout_s) from None
        except asyncio.CancelledError:
            # gRPC raises it, too, when another task closed the channel under this call.
            task = asyncio.current_task()
            if not self._closed.is_set() or (task and task.cancelling()):
                raise
            raise Cancelled("this client was closed") from None
        return self.decode(method, answer)

    def open(self, method: Method[Any], request: bytes, *, newest_only: bool) -> "Responses":
        """Starts a server-streaming call.

        Args:
            method: One of `STREAMS`.
            request: Its request.
            newest_only: Whether an unread item is replaced by a newer one.

        Raises:
            Cancelled: The client is closed.
        """
        self.check_open()
        stream: Any = self._channel.unary_stream(method.path)
        call = stream(request, metadata=self._metadata)
        return Responses(call, method, self, newest_only=newest_only)

    def pull(self, method: Method[ResultT], request: bytes) -> "Pull[ResultT]":
        """Starts a server-streaming call whose responses are received one at a time.

        Raises:
            Cancelled: The client is closed.
        """
        self.check_open()
        stream: Any = self._channel.unary_stream(method.path)
        return Pull(stream(request, metadata=self._metadata), method, self)

    def open_both_ways(self, method: Method[ResultT]) -> "Duplex[ResultT]":
        """Starts a call whose requests and responses are streams.

        Raises:
            Cancelled: The client is closed.
        """
        self.check_open()
        call: Any = self._channel.stream_stream(method.path)(metadata=self._metadata)
        return Duplex(call, method, self)

    def decode(self, method: Method[ResultT], answer: bytes) -> ResultT:
        """Returns the result of an answer.

        Raises:
            GatewayFailed: It is unreadable. As a deserializer of gRPC, `Method.decode` would lose its error.
        """
        try:
            return method.decode(answer)
        except DecodeError as error:
            raise GatewayFailed(
                f"the robot gateway at {self._target} sent an unreadable answer to {method.name}"
            ) from error

    async def sleep(self, seconds: float) -> None:
        """Sleeps.

        Raises:
            Cancelled: The client was closed meanwhile.
        """
        try:
            async with asyncio.timeout(seconds):
                await self._closed.wait()
        except TimeoutError:
            return
        self.check_open()

    def check_open(self) -> None:
        """Raises `Cancelled` once the client is closed."""
        if self._closed.is_set():
            raise Cancelled("this client is closed")

    def end_of_stream(self, failure: grpc.RpcError | None) -> GatewayError:
        """Returns the error for a stream that the other side ended; without failure, for an orderly end."""
        if failure is None:
            # As a gateway that stops completes its streams.
            return Unreachable(f"no robot gateway reached at {self._target}: it ended the stream")
        return error_from(failure, self._target, 0.0)

    async def close(self) -> None:
        """Closes the channel. Pending calls and streams end with `Cancelled`."""
        self._closed.set()
        await self._channel.close()


class Responses:
    """The items of one server-streaming call, received by a task of its own."""

    def __init__(
        self, call: Any, method: Method[Any], transport: GrpcTransport, *, newest_only: bool
    ) -> None:
        self._method = method
        self._transport = transport
        self._newest_only = newest_only
        self._queue: asyncio.Queue[Any] = asyncio.Queue(1 if newest_only else _MOST_WAITING)
        self._task = asyncio.create_task(self._receive(call), name="gateway-stream")

    async def read(self, within_s: float) -> Any:
        """Returns the next item.

        Raises:
            GatewayError: The stream ended, the client is closed, or nothing came within `within_s` seconds.
        """
        self._transport.check_open()
        try:
            async with asyncio.timeout(within_s):
                item = await self._queue.get()
        except TimeoutError:
            raise DeadlineExceeded(f"the robot gateway sent nothing for {within_s:.1f} s") from None
        if isinstance(item, GatewayError):
            raise item
        return item

    def cancel(self) -> None:
        """Ends the call."""
        self._task.cancel()

    async def _receive(self, call: Any) -> None:
        try:
            error = await self._receive_all(call)
            # Behind the items that wait to be read.
            await self._queue.put(error)
        except asyncio.CancelledError:
            call.cancel()
            if not self._task.cancelling():
                raise
            # Not raised: the task would keep the traceback and, with it, the call, whose connection would
            # stay open until Python's collector comes.

    async def _receive_all(self, call: Any) -> GatewayError:
        """Receives until the stream ends; returns why."""
        try:
            async for answer in call:
                item = self._transport.decode(self._method, answer)
                if self._newest_only and self._queue.full():
                    self._queue.get_nowait()
                await self._queue.put(item)
        except grpc.RpcError as failure:
            return self._transport.end_of_stream(failure)
        except GatewayFailed as failure:
            call.cancel()
            # Without the frames of this call, which would keep it.
            return failure.with_traceback(None)
        except asyncio.CancelledError:
            if self._task.cancelling():
                raise
            # gRPC raises it, too, when the channel was closed under the call.
            return Cancelled("this client was closed")
        return self._transport.end_of_stream(None)


class Pull(Generic[ResultT]):
    """A call whose responses are received one at a time, each when it is read: none waits in memory."""

    def __init__(self, call: Any, method: Method[ResultT], transport: GrpcTransport) -> None:
        self._call = call
        self._method = method
        self._transport = transport

    async def read(self, within_s: float | None = None) -> ResultT:
        """Returns the next response.

        Args:
            within_s: How long to wait for it; None waits for as long as the call lasts.

        Raises:
            GatewayError: The call has ended, or nothing came in time.
        """
        try:
            async with asyncio.timeout(within_s):
                answer = await self._call.read()
        except TimeoutError:
            raise DeadlineExceeded(f"the robot gateway sent nothing for {within_s:.1f} s") from None
        except grpc.RpcError as failure:
            raise self._transport.end_of_stream(failure) from None
        except asyncio.CancelledError:
            task = asyncio.current_task()
            # gRPC raises it, too, when the channel was closed under the call.
            if task and task.cancelling():
                raise
            raise Cancelled("this client was closed") from None
        if answer is grpc.aio.EOF:
            raise await self._end()
        return self._transport.decode(self._method, answer)

    def cancel(self) -> None:
        """Ends the call at once."""
        self._call.cancel()

    async def _end(self) -> GatewayError:
        """Returns why the call has ended."""
        if await self._call.code() is grpc.StatusCode.OK:
            return self._transport.end_of_stream(None)
        return self._transport.end_of_stream(
            grpc.aio.AioRpcError(
                await self._call.code(),
                await self._call.initial_metadata(),
                await self._call.trailing_metadata(),
                await self._call.details(),
            )
        )


class Duplex(Pull[ResultT]):
    """A call whose requests and responses are streams. One task may write while another reads."""

    async def write(self, request: bytes) -> None:
        """Sends a request; returns when gRPC has taken it.

        Raises:
            GatewayError: The call has ended.
        """
        try:
            await self._call.write(request)
        except (grpc.RpcError, asyncio.InvalidStateError):
            raise await self._end() from None

    async def finish(self) -> None:
        """Ends the requests; the gateway then ends the call."""
        try:
            await self._call.done_writing()
        except (grpc.RpcError, asyncio.InvalidStateError):
            return  # It has ended already.


def _tls(credentials: Credentials) -> grpc.ChannelCredentials:
    return grpc.ssl_channel_credentials(
        credentials.ca_certificate, credentials.client_key, credentials.client_certificate
    )
