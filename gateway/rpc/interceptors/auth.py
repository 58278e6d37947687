"""Authentication and authorization of every call; streams whose credential is revoked end."""

import asyncio
import hashlib
import logging
import ssl
from collections.abc import Awaitable, Coroutine
from functools import lru_cache
from typing import Any, Final, NoReturn

import grpc

from common.errors import DomainError, NotAllowedError, NotAuthenticatedError, TooMuchError
from common.grpc_errors import STATUS_CODES, metadata_of
from common.interceptors import Interceptor, RpcContext
from common.reasons import Reason
from gateway.access.authenticator import Authenticator, combined
from gateway.access.credential import Principal
from gateway.access.lockout import Lockout
from gateway.rpc.calls.call import CallContext
from gateway.rpc.calls.methods import Method, Open
from gateway.rpc.calls.ports import CredentialFiles, StreamKey
from gateway.rpc.connections.admission import Admission
from gateway.rpc.connections.refusal_delay import RefusalDelay

_log = logging.getLogger(__name__)

CHECK_EVERY_S: Final = 0.25
"""How often credentials are checked for expiry; changes of their list are applied at once."""
_ABORT_WITHIN_S: Final = 0.25
"""How long a caller has to take the status of a stream that ends; one that doesn't read gets none."""
_ABORTS_PER_TURN: Final = 4
"""Each takes about 0.3 ms of the event loop."""
TOKEN_HEADER: Final = "authorization"  # noqa: S105  # a name
"""Bearer tokens travel as in HTTP (RFC 6750 2.1)."""
_SCHEME: Final = "bearer"
_CERTIFICATE: Final = "x509_pem_cert"
"""gRPC's name of the verified client certificate in `auth_context`."""
_REMEMBERED_CERTIFICATES: Final = 256


class Auth(Interceptor[CallContext]):
    """Refuses callers without a valid credential. Their roles are examined further in, by `Authorization`.

    Args:
        authenticator: knows the credentials.
        lockout: delays those who show wrong ones.
        files: read again when an unknown credential is shown.
        stream_key: renewed when a caller that was admitted loses access.
        admission: gives connections their places.
        refusals: delays the refusals of the others.
        certificates: whether connections show client certificates.
    """

    def __init__(
        self,
        authenticator: Authenticator,
        lockout: Lockout,
        files: CredentialFiles,
        stream_key: StreamKey,
        *,
        admission: Admission,
        refusals: RefusalDelay,
        certificates: bool,
    ) -> None:
        self._authenticator = authenticator
        self._lockout = lockout
        self._files = files
        self._stream_key = stream_key
        self._admission = admission
        self._refusals = refusals
        self._certificates = certificates
        self._admitted: dict[tuple[str, ...], Principal] = {}
        """By their credentials, of which there are as many as the robot has."""
        self._streams: dict[CallContext, asyncio.Task[object]] = {}
        self._aborts: set[asyncio.Task[None]] = set()

    def applies_to(self, method: Method) -> bool:
        """Returns whether the method needs a credential."""
        return method.needed is not Open.PUBLIC

    async def on_call(self, call: CallContext) -> None:
        """Sets the call's principal.

        Raises:
            NotAuthenticatedError: no valid credential was shown.
            TooMuchError: too many wrong credentials came from there, or all places are taken.
        """
        try:
            call.principal = principal = await self._authenticate(call)
            self._admit(call, principal)
        except (NotAuthenticatedError, TooMuchError) as error:
            self._dismiss(call)
            await self._refuse(call, error)
        self._admitted[principal.credential_ids] = principal
        if call.method.streaming:
            task = asyncio.current_task()
            assert task is not None  # noqa: S101  # gRPC serves each call in a task of its own
            self._streams[call] = task

    def authorize(self, call: CallContext) -> Awaitable[None] | None:
        """Returns None if the role of an authenticated caller suffices.

        Raises:
            NotAllowedError: the method needs another role; from the awaitable, after a delay.
        """
        assert call.principal is not None  # noqa: S101  # on_call has set it
        try:
            _authorize(call.principal, call.method)
        except NotAllowedError as error:
            return self._refuse(call, error)
        return None

    def _refuse(self, call: CallContext, error: DomainError) -> Coroutine[Any, Any, NoReturn]:
        """Returns what raises the error after a delay."""
        call.refusal = error
        if self._refusals.full:
            # A place protects no connection that shows wrong credentials beside valid ones.
            self._admission.note_excess(call.peer)
        return self._refusals.refuse(error, call.waited_s)

    def _admit(self, call: CallContext, principal: Principal) -> None:
        try:
            self._admission.admit(call.peer, principal.name, principal.credential_ids)
        except TooMuchError:
            # A stop needs no place.
            if not call.method.unlimited:
                raise

    def on_response(self, call: CallContext, _response: Any) -> None:
        """Withholds the response of a caller that lost access while it waited: it may hold a new secret.

        Raises:
            NotAuthenticatedError: the credential is no longer valid.
        """
        principal = call.principal
        assert principal is not None  # noqa: S101  # on_call has set it
        # Its own principal is there unless another call has replaced it, or the caller has lost access.
        if self._admitted.get(principal.credential_ids) is principal:
            return
        if not self._authenticator.still_valid(principal):
            raise self._authenticator.access_lost()

    def knows(self, call: CallContext) -> bool:
        """Returns whether the caller shows a valid credential; waits for nothing, and counts no failure."""
        return self._authenticator.accepts(token_of(call.rpc), self._fingerprint_of(call))

    def on_end(self, call: CallContext, _error: BaseException | None) -> None:
        """Forgets a stream that has ended."""
        self._streams.pop(call, None)

    async def run(self) -> NoReturn:
        """Applies expiry until cancelled."""
        try:
            while True:
                await asyncio.sleep(CHECK_EVERY_S)
                self.end_revoked()
        finally:
            for each in self._aborts:
                each.cancel()

    def end_revoked(self) -> None:
        """Ends every stream whose credential is no longer valid, and renews the secret its caller knows.

        Its caller's connections lose their places, also those without a stream.

        Does not wait for the callers: one that does not read delays no other.
        """
        valid = self._authenticator.still_valid
        lost = [ids for ids, each in self._admitted.items() if not valid(each)]
        for credential_ids in lost:
            del self._admitted[credential_ids]
        if lost:
            self._stream_key.renew_passphrase()
        ended = []
        for call in [each for each in self._streams if each.principal and not valid(each.principal)]:
            ended.append((call, self._streams.pop(call)))
            call.refusal = self._authenticator.access_lost()
        if lost:
            # Calls of the health service, which need no credential, would keep them.
            self._admission.dismiss_callers(lost, self._callers_of_streams())
        if ended:
            self._abort_later(self._abort_all(ended), name="revocation of streams")

    def _callers_of_streams(self) -> dict[str, tuple[str, ...]]:
        """Returns the credentials of a caller with an open stream, by `Peer.address` of its connection."""
        return {each.peer.address: each.principal.credential_ids for each in self._streams if each.principal}

    def _abort_later(self, aborting: Coroutine[Any, Any, None], name: str) -> None:
        abort = asyncio.create_task(aborting, name=name)
        self._aborts.add(abort)
        abort.add_done_callback(self._aborts.discard)

    async def _abort_all(self, ended: "list[tuple[CallContext, asyncio.Task[object]]]") -> None:
        """Begins to abort these calls, a few in each turn of the event loop: other callers wait meanwhile."""
        for number, (call, task) in enumerate(ended, start=1):
            self._abort_later(self._abort(call, task), name="revocation of a stream")
            if number % _ABORTS_PER_TURN == 0:
                await asyncio.sleep(0)

    def _dismiss(self, call: CallContext) -> None:
        """Takes the connection's place away, unless a stream of a valid caller is open on it."""
        # A stranger's has none, and is not searched for: there may be thousands of such calls a second.
        if self._admission.is_pending(call.peer):
            return
        address = call.peer.address
        if not any(each.peer.address == address for each in self._streams):
            self._admission.dismiss(call.peer)

    async def _abort(self, call: CallContext, task: "asyncio.Task[object]") -> None:
        """Aborts the call with the reason, and cancels it on our side whether or not the caller reads."""
        error = self._authenticator.access_lost()
        who = call.principal.name if call.principal else ""
        _log.info("access: %s of %s ended, its credential is no longer valid", call.method.name, who)
        code = STATUS_CODES[NotAuthenticatedError]
        aborting = call.rpc.abort(code, str(error), trailing_metadata=metadata_of(error, code))
        try:
            async with asyncio.timeout(_ABORT_WITHIN_S):
                await self._aborted(aborting, task)
        except TimeoutError:
            pass  # The caller does not read.
        finally:
            task.cancel()

    @staticmethod
    async def _aborted(aborting: Awaitable[NoReturn], task: "asyncio.Task[object]") -> None:
        """Returns when the status has been sent."""
        try:
            await aborting
        except grpc.aio.AbortError:
            pass  # grpc.aio raises it whenever it has aborted.
        except grpc.aio.BaseError:
            # The caller has gone; or `on_response` refuses the stream just now, which must not be cut short.
            await asyncio.wait([task])

    async def _authenticate(self, call: CallContext) -> Principal:
        token, fingerprint = token_of(call.rpc), self._fingerprint_of(call)
        if token is None and fingerprint is None:
            raise NotAuthenticatedError(
                "this robot asks callers for a credential; type: robotctl login", Reason.CREDENTIAL_MISSING
            )
        if not self._lists(token, fingerprint):
            await self._files.reload_for_unknown()
        by_certificate = None
        if fingerprint is not None:
            by_certificate = self._authenticator.authenticate_certificate(fingerprint)
        by_token = self._of_token(call, token) if token is not None else None
        if by_certificate and by_token:
            return combined(by_certificate, by_token)
        found = by_certificate or by_token
        assert found is not None  # noqa: S101  # one of them was shown
        return found

    def _fingerprint_of(self, call: CallContext) -> str | None:
        return fingerprint_of(call.rpc) if self._certificates else None

    def _lists(self, token: str | None, fingerprint: str | None) -> bool:
        return (token is None or bool(self._authenticator.id_of_token(token))) and (
            fingerprint is None or self._authenticator.knows_certificate(fingerprint)
        )

    def _of_token(self, call: CallContext, token: str) -> Principal:
        prefix, owner = call.peer.address_prefix, self._authenticator.id_of_token(token)
        try:
            principal = self._authenticator.authenticate_token(token)
        except NotAuthenticatedError as error:
            # An expired or revoked token is no guess: its secret was right.
            if error.reason is Reason.CREDENTIAL_UNKNOWN:
                self._lockout.check(prefix, owner)
                if self._lockout.failed(prefix, owner):
                    meant = f"credential {owner}" if owner else "no credential of this robot"
                    _log.warning(
                        "access: %s shows wrong tokens (%s) and is locked out", call.peer.host, meant
                    )
            raise
        self._lockout.succeeded(prefix, owner)
        return principal


class Authorization(Interceptor[CallContext]):
    """Refuses callers whose role does not suffice.

    Further in than `CallerLimit`: a refusal costs nearly as much as a response, and takes as much of the
    caller's share.

    Args:
        auth: has authenticated the caller.
    """

    def __init__(self, auth: Auth) -> None:
        self._auth = auth

    def applies_to(self, method: Method) -> bool:
        """Returns whether the method needs a credential."""
        return self._auth.applies_to(method)

    def on_call(self, call: CallContext) -> Awaitable[None] | None:
        """Compares the caller's role with the method's.

        Raises:
            NotAllowedError: the method needs another role; from the awaitable, after a delay.
        """
        return self._auth.authorize(call)


def token_of(rpc: RpcContext) -> str | None:
    """Returns the bearer token of a call; None without one, "" for another kind of authorization."""
    for key, value in rpc.invocation_metadata() or ():
        if key == TOKEN_HEADER:
            scheme, _, text = (value if isinstance(value, str) else "").partition(" ")
            return text.strip() if scheme.lower() == _SCHEME else ""
    return None


def fingerprint_of(rpc: RpcContext) -> str | None:
    """Returns the SHA-256 of the client certificate, whose key TLS has verified; None without one."""
    found = rpc.auth_context().get(_CERTIFICATE)
    return _fingerprint(next(iter(found))) if found else None


@lru_cache(maxsize=_REMEMBERED_CERTIFICATES)
def _fingerprint(pem: bytes) -> str:
    return hashlib.sha256(ssl.PEM_cert_to_DER_cert(pem.decode("ascii"))).hexdigest()


def _authorize(principal: Principal, method: Method) -> None:
    needed = method.needed
    if isinstance(needed, Open):
        raise NotAllowedError(f"{method.name} declares no role, so no one may call it")
    if not principal.role.may(needed):
        raise NotAllowedError(
            f"{principal.name} is {principal.role.value}, and {method.name} needs {needed.value}"
        )
