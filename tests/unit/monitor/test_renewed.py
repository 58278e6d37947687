"""Which login a client shows, and when it takes another one over. Nothing is called: nobody listens."""

from collections.abc import Callable

from common.errors import UserError
from console.client import AsyncGatewayClient, ClientOptions, Credentials
from console.monitor.renewed import RenewedClient

OLD, NEW = Credentials(token="old"), Credentials(token="new")


class Made(RenewedClient):
    """Notes what its clients show."""

    def __init__(self, login: Callable[[], Credentials]) -> None:
        self.shows: list[Credentials] = []
        super().__init__("127.0.0.1:9", ClientOptions(), login, OLD)

    def _client_with(self, shown: Credentials) -> AsyncGatewayClient:
        client = super()._client_with(shown)
        self.shows.append(shown)
        return client


async def test_the_same_login_makes_no_new_client() -> None:
    async with Made(lambda: Credentials(token="old")) as client:
        assert not await client.renew()
        assert client.shows == [OLD]


async def test_another_one_is_taken_over_once() -> None:
    stored = OLD
    async with Made(lambda: stored) as client:
        stored = NEW
        assert await client.renew()
        assert not await client.renew()
        assert client.shows == [OLD, NEW]


async def test_what_can_not_be_used_leaves_the_one_in_use() -> None:
    stored: Credentials | UserError = UserError("the token file can't be read")

    def login() -> Credentials:
        if isinstance(stored, UserError):
            raise stored
        return stored

    async with Made(login) as client:
        assert not await client.renew()
        # Half of one: a certificate, and nothing that says who the robot is.
        stored = Credentials(client_certificate=b"x", client_key=b"x")
        assert not await client.renew()
        assert client.shows == [OLD]
        stored = NEW
        assert await client.renew()
        assert client.shows == [OLD, NEW]
