"""No name of ours is one of the NATS library's, and each hook that ours override is there."""

from nats.aio.client import Client
from nats.aio.transport import TcpTransport
from nats.protocol.parser import Parser

from fleet import nats_client
from fleet.replies import NotTaken


def added(ours: object, library: object) -> set[str]:
    """Names that the instance and its class have of their own: those that the library's lacks."""
    names = vars(ours).keys() | vars(type(ours)).keys()
    return {each for each in names if not each.startswith("__")} - set(dir(library))


async def test_a_client_has_no_name_of_the_librarys_but_its_hooks() -> None:
    """One more: the library has dropped a hook. One fewer: it has taken a name of ours."""
    ours = nats_client._BoundedClient(NotTaken())
    assert added(ours, Client()) == {"_not_taken", "_own_transport", "abort", "farewell", "is_encrypted"}


def test_a_transport_has_none() -> None:
    ours = nats_client._Transport()  # type: ignore[no-untyped-call]  # the library's
    assert added(ours, TcpTransport()) == {"_held", "_tcp", "_writer", "abort"}  # type: ignore[no-untyped-call]


def test_a_parser_has_none() -> None:
    assert added(nats_client._BoundedParser(), Parser()) == set()
