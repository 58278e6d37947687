"""The guard: one interceptor for every call. Who asks, may they, may they still while a stream lasts?"""

import asyncio
import logging
from collections.abc import AsyncIterator, Awaitable, Callable
from dataclasses import dataclass
from typing import Any, Final, NoReturn

import grpc

from common import request_id
from common.error_details import metadata_of
from common.errors import NotAllowedError, NotAuthenticatedError, TooMuchError
from common.reasons import Reason
from common.rpc import STATUS_CODES, Context, Handler, rewrapped
from gateway.access.address_prefix import address_prefix
from gateway.access.audit import AuditRecord
from gateway.access.authenticator import Authenticator, combined
from gateway.access.credential import Principal
from gateway.access.lockout import Lockout
from gateway.access.refusal_limiter import RefusalLimiter
from gateway.access.role import Role
from gateway.rpc.identity import begin, fingerprint_of, token_of
from gateway.rpc.method_roles import Needed, Open, needed_for
from gateway.rpc.peer import address_of, host_of

_log = logging.getLogger(__name__)

LOOK_EVERY_S: Final = 0.5
"""How often open streams are looked at: whether the credential is still valid by which each was opened."""
_END_WITHIN_S: Final = 1.0
"""How long a caller may take to be told that a stream ends; one that doesn't read is not told."""
_WRONG: Final = (Reason.CREDENTIAL_UNKNOWN,)
"""Refusals of somebody who may be guessing. Who shows an expired credential has proved whose it was."""


@dataclass(eq=False, slots=True)
class _OpenStream:
    method: str
    principal: Principal
    context: Context
    task: "asyncio.Task[Any]"


class Guard(grpc.aio.ServerInterceptor):
    """Belongs to one event loop.

    Args:
        authenticator: knows the credentials.
        lockout: remembers who showed wrong ones.
        refused: takes the record of a control action that was refused here.
        reload_for_unknown: reads the list of credentials again when one is shown that it does not have.
        somebody_is_out: called when one who was let in would not be any more: what they know is to change.
        certificates: whether connections show certificates.
    """

    def __init__(
        self,
        authenticator: Authenticator,
        lockout: Lockout,
        refused: Callable[[AuditRecord], None],
        reload_for_unknown: Callable[[], Awaitable[None]],
        somebody_is_out: Callable[[], None],
        *,
        certificates: bool,
    ) -> None:
        self._authenticator = authenticator
        self._lockout = lockout
        self._refused = refused
        self._reload_for_unknown = reload_for_unknown
        self._somebody_is_out = somebody_is_out
        self._let_in: dict[tuple[str, ...], Principal] = {}
        """By their credentials, of which the robot has a list."""
        self._refusal_limiter = RefusalLimiter()
        self._certificates = certificates
        self._streams: set[_OpenStream] = set()

    async def intercept_service(
        self,
        continuation: Callable[[grpc.HandlerCallDetails], Awaitable[Handler | None]],
        handler_call_details: grpc.HandlerCallDetails,
    ) -> Handler | None:
        """Wraps the method's handler; asked once per method."""
        method = handler_call_details.method
        handler = await continuation(handler_call_details)
        if handler is None:
            return None
        needed = needed_for(method)
        if needed is Open.EVERYBODY:
            return handler
        return rewrapped(
            handler,
            lambda behavior: self._unary(behavior, method, needed),
            lambda behavior: self._stream(behavior, method, needed),
        )

    async def run(self) -> NoReturn:
        """Ends streams whose credential is over, until cancelled."""
        while True:
            await asyncio.sleep(LOOK_EVERY_S)
            await self.end_what_is_over()

    async def end_what_is_over(self) -> None:
        """Ends every stream whose caller would not be let in any more, and tells of those callers."""
        out = [key for key, each in self._let_in.items() if not self._authenticator.still_valid(each)]
        for key in out:
            del self._let_in[key]
        if out:
            self._somebody_is_out()
        over = [each for each in self._streams if not self._authenticator.still_valid(each.principal)]
        await asyncio.gather(*(self._end(each) for each in over))

    def _unary(self, behavior: Any, method: str, needed: Needed) -> Any:
        async def call(request: Any, context: Context) -> Any:
            begin(await self._admit(context, method, needed))
            return await behavior(request, context)

        return call

    def _stream(self, behavior: Any, method: str, needed: Needed) -> Any:
        async def call(request: Any, context: Context) -> AsyncIterator[Any]:
            principal = await self._admit(context, method, needed)
            begin(principal)
            task = asyncio.current_task()
            assert task is not None, "gRPC serves each call in a task of its own"
            stream = _OpenStream(method, principal, context, task)
            self._streams.add(stream)
            try:
                async for response in behavior(request, context):
                    yield response
            finally:
                self._streams.discard(stream)

        return call

    async def _admit(self, context: Context, method: str, needed: Needed) -> Principal:
        """Who calls, when they may.

        Raises:
            DomainError: they may not.
        """
        principal = None
        try:
            principal = await self._identify(context)
            _hold_to(needed, principal, method)
        except (NotAuthenticatedError, NotAllowedError, TooMuchError) as error:
            self._note_refusal(context, method, needed, principal, error)
            raise
        self._let_in[principal.credential_ids] = principal
        return principal

    async def _identify(self, context: Context) -> Principal:
        token = token_of(context)
        fingerprint = fingerprint_of(context) if self._certificates else None
        if token is None and fingerprint is None:
            raise NotAuthenticatedError(
                "this robot wants to know who asks; robotctl login tells it",
                Reason.CREDENTIAL_MISSING,
            )
        unknown = (token is not None and not self._authenticator.id_of_token(token)) or (
            fingerprint is not None and not self._authenticator.knows_certificate(fingerprint)
        )
        if unknown:
            await self._reload_for_unknown()
        by_certificate = (
            self._authenticator.authenticate_certificate(fingerprint) if fingerprint is not None else None
        )
        by_token = self._of_token(context, token) if token is not None else None
        if by_certificate and by_token:
            return combined(by_certificate, by_token)
        found = by_certificate or by_token
        assert found is not None, "one of them was shown"
        return found

    def _of_token(self, context: Context, token: str) -> Principal:
        host, owner = host_of(context.peer()), self._authenticator.id_of_token(token)
        self._lockout.admit(host, owner)
        try:
            principal = self._authenticator.authenticate_token(token)
        except NotAuthenticatedError as error:
            if error.reason in _WRONG and self._lockout.failed(host, owner):
                meant = f"credential {owner}" if owner else "no credential of this robot"
                _log.warning("access: %s shows wrong tokens (%s) and is locked out", host, meant)
            raise
        self._lockout.succeeded(host, owner)
        return principal

    def _note_refusal(
        self,
        context: Context,
        method: str,
        needed: Needed,
        principal: Principal | None,
        error: NotAuthenticatedError | NotAllowedError | TooMuchError,
    ) -> None:
        if needed not in (Role.OPERATOR, Role.ADMIN) or isinstance(error, TooMuchError):
            return
        peer = context.peer()
        left_out = self._refusal_limiter.take(principal.name if principal else address_prefix(host_of(peer)))
        if left_out is None:
            return
        more = f" ({left_out} attempts before this one are left out)" if left_out else ""
        self._refused(
            AuditRecord(
                who=principal.name if principal else "",
                role=principal.role.value if principal else "",
                credential=principal.credential_ids[0] if principal else "",
                address=address_of(peer),
                action=method.rpartition("/")[2],
                request="",
                result="refused",
                answer=f"{error}{more}",
                request_id=request_id.current(),
            )
        )

    async def _end(self, stream: _OpenStream) -> None:
        """Tells the caller why, and ends the stream on our side whether or not they listen."""
        error = NotAuthenticatedError(
            "the credential by which this stream was opened is not valid any more",
            Reason.CREDENTIAL_REVOKED,
        )
        _log.info(
            "access: %s of %s ended, the credential is not valid any more",
            stream.method,
            stream.principal.name,
        )
        self._streams.discard(stream)
        code = STATUS_CODES[NotAuthenticatedError]
        telling = stream.context.abort(code, str(error), trailing_metadata=metadata_of(error, code))
        try:
            await asyncio.wait_for(telling, _END_WITHIN_S)
        except (grpc.aio.BaseError, TimeoutError):
            # Told (gRPC raises whenever it has aborted); gone already; or it does not read.
            pass
        finally:
            stream.task.cancel()


def _hold_to(needed: Needed, principal: Principal, method: str) -> None:
    name = method.rpartition("/")[2]
    if isinstance(needed, Open):
        raise NotAllowedError(f"{name} declares no role, so nobody may call it")
    if not principal.role.may(needed):
        raise NotAllowedError(f"{principal.name} is {principal.role.value}, and {name} needs {needed.value}")
