"""Which credentials a client presents, and when it takes others over. No call is made."""

from collections.abc import Callable

from common.errors import UserError
from console.client import AsyncGatewayClient, ClientOptions, Credentials
from console.monitor.credential_refresh import RefreshingClient

OLD, NEW = Credentials(token="old"), Credentials(token="new")


class Made(RefreshingClient):
    """Notes what its clients show."""

    def __init__(self, login: Callable[[], Credentials]) -> None:
        self.shows: list[Credentials] = []
        super().__init__("127.0.0.1:9", ClientOptions(), login, OLD)

    def _make_client(self, credentials: Credentials) -> AsyncGatewayClient:
        client = super()._make_client(credentials)
        self.shows.append(credentials)
        return client


async def test_the_same_login_makes_no_new_client() -> None:
    async with Made(lambda: Credentials(token="old")) as client:
        assert not await client.refresh()
        assert client.shows == [OLD]


async def test_another_one_is_taken_over_once() -> None:
    stored = OLD
    async with Made(lambda: stored) as client:
        stored = NEW
        assert await client.refresh()
        assert not await client.refresh()
        assert client.shows == [OLD, NEW]


async def test_what_can_not_be_used_leaves_the_one_in_use() -> None:
    stored: Credentials | UserError = UserError("the token file can't be read")

    def login() -> Credentials:
        if isinstance(stored, UserError):
            raise stored
        return stored

    async with Made(login) as client:
        assert not await client.refresh()
        # Half of one: a certificate, and nothing that says who the robot is.
        stored = Credentials(client_certificate=b"x", client_key=b"x")
        assert not await client.refresh()
        assert client.shows == [OLD]
        stored = NEW
        assert await client.refresh()
        assert client.shows == [OLD, NEW]
