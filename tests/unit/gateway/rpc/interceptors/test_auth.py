"""Callers that lose access are noticed once, and only those that had been admitted."""

import asyncio
from collections.abc import Awaitable
from contextlib import suppress
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import grpc
import pytest

from common.errors import NotAllowedError, NotAuthenticatedError, TooMuchError
from common.grpc_errors import ErrorInterceptor
from common.reasons import Reason
from gateway.access.authenticator import Authenticator
from gateway.access.credential import Credential, Kind
from gateway.access.lockout import FREE_FAILURES, Lockout
from gateway.access.role import Role
from gateway.access.store import Store
from gateway.access.token import Token, hash_of, new_token
from gateway.config import LimitSettings
from gateway.rpc.calls.call import CallContext
from gateway.rpc.connections.admission import Admission
from gateway.rpc.connections.refusal_delay import REFUSAL_DELAY_S, REFUSAL_SPACING_S, RefusalDelay
from gateway.rpc.interceptors.auth import Auth, Authorization
from tests.support.calls import call_of, serve
from tests.support.virtual_time import in_virtual_time


class Ground:
    """An interceptor, its list of credentials, and what it has asked for."""

    def __init__(self) -> None:
        self.tokens = {name: new_token(name[0] * 12) for name in ("anna", "ben", "carla")}
        self.credentials = {name: _credential(name, token) for name, token in self.tokens.items()}
        self.authenticator = Authenticator(Store(MappingProxyType({})))
        self.reload()
        self.renewals = 0
        self.looks = 0
        self.admission = Admission(LimitSettings())
        self.auth = Auth(
            self.authenticator,
            Lockout(),
            self,
            self,
            admission=self.admission,
            refusals=RefusalDelay(),
            certificates=False,
        )

    async def reload_for_unknown(self) -> None:
        self.looks += 1
        self.reload()

    def renew_passphrase(self) -> None:
        self.renewals += 1

    def reload(self) -> None:
        """As when the gateway has read its files again."""
        listed = {each.credential_id: each for each in self.credentials.values()}
        self.authenticator.use(Store(MappingProxyType(listed)))

    def revoke(self, *names: str) -> None:
        for name in names:
            self.credentials[name] = replace(self.credentials[name], revoked_s=1)
        self.reload()

    async def ping(self, name: str) -> Any:
        async def answer(_request: Any, call: CallContext) -> bytes:
            assert call.principal is not None
            return call.principal.name.encode()

        return await serve([self.auth], "Ping", answer, token=self.tokens[name].text())


def _credential(name: str, token: Token) -> Credential:
    return Credential(
        credential_id=token.credential_id,
        name=name,
        role=Role.VIEWER,
        kind=Kind.TOKEN,
        proof=hash_of(token),
        made_s=0,
    )


@pytest.fixture
def ground() -> Ground:
    return Ground()


async def test_nothing_happens_while_all_credentials_are_valid(ground: Ground) -> None:
    assert await ground.ping("anna") == b"anna"
    ground.auth.end_revoked()
    assert ground.renewals == 0


@in_virtual_time
async def test_an_admitted_caller_that_loses_access_is_noticed_once(ground: Ground) -> None:
    for name in ("anna", "ben", "ben"):
        await ground.ping(name)
    ground.revoke("anna", "ben")
    for _ in range(3):
        ground.auth.end_revoked()
    assert ground.renewals == 1
    with pytest.raises(NotAuthenticatedError, match="was revoked"):
        await ground.ping("anna")
    ground.auth.end_revoked()
    assert ground.renewals == 1


@in_virtual_time
async def test_a_caller_that_loses_access_loses_its_place_though_it_makes_no_call(ground: Ground) -> None:
    """The defect: watching the health service, which needs no credential, it kept the place for ever."""
    peer = call_of().peer
    ground.admission.take_token(peer)
    await ground.ping("anna")
    ground.admission.open_stream(peer)
    ground.auth.end_revoked()
    assert not ground.admission.is_pending(peer)
    ground.revoke("anna")
    ground.auth.end_revoked()
    assert ground.admission.is_pending(peer)


@in_virtual_time
async def test_a_place_stays_with_the_caller_that_was_admitted_last(ground: Ground) -> None:
    peer = call_of().peer
    ground.admission.take_token(peer)
    for name in ("anna", "ben"):
        await ground.ping(name)
    ground.revoke("anna")
    ground.auth.end_revoked()
    assert not ground.admission.is_pending(peer)


async def test_a_place_stays_while_a_stream_of_another_caller_is_open(ground: Ground) -> None:
    pending = []

    async def answers(_request: Any, call: CallContext) -> Any:
        await ground.ping("anna")
        ground.revoke("anna")
        ground.auth.end_revoked()
        pending.append(ground.admission.is_pending(call.peer))
        yield b"a status"

    ground.admission.take_token(call_of().peer)
    await serve([ground.auth], "WatchSystemStatus", answers, token=ground.tokens["ben"].text())
    assert pending == [False]


@in_virtual_time
async def test_a_place_left_to_the_caller_of_a_stream_is_lost_with_its_access(ground: Ground) -> None:
    """The defect: the place stayed with the one that had lost access, and was never looked at again."""
    peer = call_of().peer

    async def answers(_request: Any, _call: CallContext) -> Any:
        await ground.ping("anna")
        ground.revoke("anna")
        ground.auth.end_revoked()
        yield b"a status"

    ground.admission.take_token(peer)
    await serve([ground.auth], "WatchSystemStatus", answers, token=ground.tokens["ben"].text())
    assert not ground.admission.is_pending(peer)
    ground.revoke("ben")
    ground.auth.end_revoked()
    assert ground.admission.is_pending(peer)


@in_virtual_time
async def test_the_end_of_a_revoked_stream_takes_no_place_of_the_newest_caller(ground: Ground) -> None:
    peer = call_of().peer

    async def answers(_request: Any, _call: CallContext) -> Any:
        yield b"a status"
        await ground.ping("ben")
        ground.revoke("anna")
        ground.auth.end_revoked()
        yield b"another"

    ground.admission.take_token(peer)
    with pytest.raises(NotAuthenticatedError):
        await serve([ground.auth], "WatchSystemStatus", answers, token=ground.tokens["anna"].text())
    assert not ground.admission.is_pending(peer)


@in_virtual_time
async def test_a_caller_that_was_never_admitted_knows_no_secret(ground: Ground) -> None:
    await ground.ping("anna")
    ground.revoke("carla")
    with pytest.raises(NotAuthenticatedError):
        await ground.ping("carla")
    ground.auth.end_revoked()
    assert ground.renewals == 0


@pytest.mark.parametrize("method", ["SetPreviewMode", "GetSystemStatus"])
async def test_an_answer_is_withheld_from_a_caller_that_lost_access_while_it_waited(
    ground: Ground, method: str
) -> None:
    async def answer(_request: Any, _call: CallContext) -> bytes:
        ground.revoke("anna")
        ground.auth.end_revoked()
        return b"the new passphrase"

    ground.credentials["anna"] = replace(ground.credentials["anna"], role=Role.OPERATOR)
    ground.reload()
    with pytest.raises(NotAuthenticatedError) as seen:
        await serve([ground.auth], method, answer, token=ground.tokens["anna"].text())
    assert seen.value.reason is Reason.CREDENTIAL_REVOKED
    assert ground.renewals == 1


async def test_calls_of_one_caller_do_not_disturb_each_other(ground: Ground) -> None:
    async def answer(_request: Any, _call: CallContext) -> Any:
        assert await ground.ping("anna") == b"anna"
        return b"answer"

    assert await serve([ground.auth], "Ping", answer, token=ground.tokens["anna"].text()) == b"answer"


async def test_a_stream_gets_nothing_after_its_caller_lost_access(ground: Ground) -> None:
    async def answers(_request: Any, _call: CallContext) -> Any:
        yield b"the passphrase"
        ground.revoke("anna")
        ground.auth.end_revoked()
        yield b"the new passphrase"

    with pytest.raises(NotAuthenticatedError):
        await serve([ground.auth], "WatchSystemStatus", answers, token=ground.tokens["anna"].text())


async def test_a_refusal_on_its_way_is_not_cut_short(ground: Ground) -> None:
    """A stream that has a status to send is refused by it before it is aborted for the lost access."""

    async def answers(_request: Any, _call: CallContext) -> Any:
        yield b"a status"
        ground.revoke("anna")
        ground.auth.end_revoked()
        yield b"another"

    with pytest.raises(grpc.aio.AbortError, match="no longer valid"):
        await serve(
            [ErrorInterceptor(), ground.auth],
            "WatchSystemStatus",
            answers,
            token=ground.tokens["anna"].text(),
        )


async def test_a_credential_added_since_the_last_look_is_accepted_at_once(ground: Ground) -> None:
    ground.tokens["dora"] = new_token("d" * 12)
    ground.credentials["dora"] = _credential("dora", ground.tokens["dora"])
    assert await ground.ping("dora") == b"dora"
    assert ground.looks == 1
    assert await ground.ping("dora") == b"dora"
    assert ground.looks == 1, "known ones cause no look"


@in_virtual_time
async def test_an_unknown_credential_causes_one_look_and_is_refused(ground: Ground) -> None:
    ground.tokens["eve"] = new_token("e" * 12)
    with pytest.raises(NotAuthenticatedError):
        await ground.ping("eve")
    assert ground.looks == 1


async def duration_s(calling: Awaitable[Any]) -> float:
    """How long a call takes; whether it is refused does not matter."""
    loop = asyncio.get_running_loop()
    began_s = loop.time()
    with suppress(NotAuthenticatedError, TooMuchError):
        await calling
    return loop.time() - began_s


@in_virtual_time
async def test_refusals_wait_for_each_other_and_valid_callers_for_none(ground: Ground) -> None:
    ground.tokens["eve"] = new_token("e" * 12)
    refused = [asyncio.create_task(duration_s(ground.ping("eve"))) for _ in range(100)]
    await asyncio.sleep(REFUSAL_DELAY_S / 2)
    assert await duration_s(ground.ping("anna")) == 0
    took_s = sorted(await asyncio.gather(*refused))
    assert took_s[0] >= REFUSAL_DELAY_S
    assert took_s[-1] == pytest.approx(REFUSAL_DELAY_S + 99 * REFUSAL_SPACING_S)


@in_virtual_time
async def test_a_role_that_does_not_suffice_is_refused_after_a_delay(ground: Ground) -> None:
    async def answer(_request: Any, _call: CallContext) -> bytes:
        return b"switched"

    async def switch() -> Any:
        interceptors = [ground.auth, Authorization(ground.auth)]
        return await serve(interceptors, "SetPreviewMode", answer, token=ground.tokens["anna"].text())

    loop = asyncio.get_running_loop()
    began_s = loop.time()
    with pytest.raises(NotAllowedError, match="needs operator"):
        await switch()
    assert loop.time() - began_s == pytest.approx(REFUSAL_DELAY_S)
    ground.credentials["anna"] = replace(ground.credentials["anna"], role=Role.OPERATOR)
    ground.reload()
    assert await switch() == b"switched"


async def test_wrong_tokens_that_can_not_be_delayed_restrain_a_connection_that_has_a_place(
    ground: Ground, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The defect: a valid stream kept the place, and with it the way around turns and delays."""
    monkeypatch.setattr("gateway.rpc.connections.refusal_delay._MAX_DELAYED", 0)
    ground.tokens["eve"] = new_token("e" * 12)
    restrained = []

    async def answers(_request: Any, call: CallContext) -> Any:
        restrained.append(ground.admission.is_restrained(call.peer))
        with pytest.raises(NotAuthenticatedError):
            await ground.ping("eve")
        restrained.append(ground.admission.is_restrained(call.peer))
        yield b"a status"

    ground.admission.take_token(call_of().peer)
    await serve([ground.auth], "WatchSystemStatus", answers, token=ground.tokens["anna"].text())
    assert restrained == [False, True]


@in_virtual_time
async def test_a_right_token_is_admitted_whatever_its_address_has_guessed(ground: Ground) -> None:
    ground.tokens["guess of anna"] = new_token("a" * 12)
    for _ in range(FREE_FAILURES + 1):
        with pytest.raises(NotAuthenticatedError, match="not one of this robot's"):
            await ground.ping("guess of anna")
    for _ in range(2):
        assert await ground.ping("anna") == b"anna"
        with pytest.raises(TooMuchError) as seen:
            await ground.ping("guess of anna")
        assert seen.value.reason is Reason.LOCKED_OUT, "the right token does not help the guesser"


async def test_while_the_list_is_unreadable_no_credential_is_accepted(ground: Ground) -> None:
    async def answers(_request: Any, _call: CallContext) -> Any:
        yield b"first"
        ground.authenticator.use(Store(), "the list can't be read")
        ground.auth.end_revoked()
        yield b"second"

    with pytest.raises(NotAuthenticatedError, match="can't be read") as seen:
        await serve([ground.auth], "WatchSystemStatus", answers, token=ground.tokens["anna"].text())
    assert seen.value.reason is Reason.CREDENTIALS_UNREADABLE
    assert ground.renewals == 1


async def test_it_knows_at_once_who_shows_a_valid_token(ground: Ground) -> None:
    """Without a look at the files, and without a failure that counts."""
    right, other = (ground.tokens[name] for name in ("anna", "ben"))
    guess = Token(right.credential_id, other.secret)
    for _ in range(2 * FREE_FAILURES):
        assert not ground.auth.knows(call_of(token=guess.text()))
    for token in (None, "", "no token", new_token("f" * 12).text()):
        assert not ground.auth.knows(call_of(token=token))
    assert ground.auth.knows(call_of(token=right.text()))
    ground.revoke("anna")
    assert not ground.auth.knows(call_of(token=right.text()))
    assert ground.looks == 0
