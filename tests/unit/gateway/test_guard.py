"""Who is let in no more is noticed once, and only those who had been let in."""

from dataclasses import replace
from types import MappingProxyType, SimpleNamespace
from typing import Any

import grpc
import pytest

from common.errors import NotAuthenticatedError
from gateway.access.authenticator import Authenticator
from gateway.access.credential import Credential, Kind
from gateway.access.lockout import Lockout
from gateway.access.role import Role
from gateway.access.store import Store
from gateway.access.token import Token, hash_of, new_token
from gateway.rpc.guard import Guard
from omniseer.gateway.v1.robot_gateway_pb2 import DESCRIPTOR

PING = f"/{DESCRIPTOR.services_by_name['RobotGateway'].full_name}/Ping"


class Ground:
    """A guard, its list of credentials, and what it has told."""

    def __init__(self) -> None:
        self.tokens = {name: new_token(name[0] * 12) for name in ("anna", "ben", "carla")}
        self.credentials = {name: _credential(name, token) for name, token in self.tokens.items()}
        self.authenticator = Authenticator(Store(MappingProxyType({})))
        self.take_over()
        self.refused: list[Any] = []
        self.times_out = 0
        self.looks = 0
        self.guard = Guard(
            self.authenticator,
            Lockout(),
            self.refused.append,
            self._reload_for_unknown,
            self._somebody_is_out,
            certificates=False,
        )

    async def _reload_for_unknown(self) -> None:
        self.looks += 1
        self.take_over()

    def _somebody_is_out(self) -> None:
        self.times_out += 1

    def take_over(self) -> None:
        """As when the gateway has read its files anew."""
        listed = {each.credential_id: each for each in self.credentials.values()}
        self.authenticator.use(Store(MappingProxyType(listed)))

    def revoke(self, *names: str) -> None:
        for name in names:
            self.credentials[name] = replace(self.credentials[name], revoked_s=1)
        self.take_over()

    async def ping(self, name: str) -> Any:
        async def answer(_request: Any, _context: Any) -> str:
            return "answer"

        async def continuation(_details: Any) -> Any:
            return grpc.unary_unary_rpc_method_handler(answer)  # type: ignore[arg-type]  # an asyncio one

        details: Any = SimpleNamespace(method=PING)
        handler = await self.guard.intercept_service(continuation, details)
        assert handler
        context = SimpleNamespace(
            peer=lambda: "ipv4:10.0.0.5:4",
            invocation_metadata=lambda: (("authorization", f"Bearer {self.tokens[name].text()}"),),
        )
        return await handler.unary_unary(None, context)


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


async def test_nobody_is_out_while_all_are_valid(ground: Ground) -> None:
    assert await ground.ping("anna") == "answer"
    await ground.guard.end_what_is_over()
    assert ground.times_out == 0


async def test_who_was_let_in_and_is_not_any_more_is_noticed_once(ground: Ground) -> None:
    for name in ("anna", "ben", "ben"):
        await ground.ping(name)
    ground.revoke("anna", "ben")
    for _ in range(3):
        await ground.guard.end_what_is_over()
    assert ground.times_out == 1
    with pytest.raises(NotAuthenticatedError, match="was revoked"):
        await ground.ping("anna")
    await ground.guard.end_what_is_over()
    assert ground.times_out == 1


async def test_who_was_never_let_in_takes_nothing_along(ground: Ground) -> None:
    await ground.ping("anna")
    ground.revoke("carla")
    with pytest.raises(NotAuthenticatedError):
        await ground.ping("carla")
    await ground.guard.end_what_is_over()
    assert ground.times_out == 0


async def test_a_credential_added_since_the_last_look_is_accepted_at_once(ground: Ground) -> None:
    ground.tokens["dora"] = new_token("d" * 12)
    ground.credentials["dora"] = _credential("dora", ground.tokens["dora"])
    assert await ground.ping("dora") == "answer"
    assert ground.looks == 1
    assert await ground.ping("dora") == "answer"
    assert ground.looks == 1, "known ones cause no look"


async def test_an_unknown_credential_causes_one_look_and_is_refused(ground: Ground) -> None:
    ground.tokens["eve"] = new_token("e" * 12)
    with pytest.raises(NotAuthenticatedError):
        await ground.ping("eve")
    assert ground.looks == 1
