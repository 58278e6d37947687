"""The process that advertises the gateway by mDNS (RFC 6762) and DNS-SD (RFC 6763).

A process of its own, of the lowest priority and with bounded memory: every machine of the network may send it
packets to parse, as many as it likes, and none of that may reach the gateway.
"""

import json
import os
import resource
import signal
import socket
import sys
from typing import Any, Final

from zeroconf import ServiceInfo, Zeroconf

from common.advertisement import SERVICE_TYPE, Advertisement
from common.child import end_with_parent
from common.plain_name import plain_name
from gateway.platform.hosts import advertised_addresses

_LOOK_EVERY_S: Final = 30.0
"""How often the addresses are compared with those that are advertised."""
_LOWEST_PRIORITY: Final = 19
"""setpriority(2)."""
_MEMORY_BYTES: Final = 512 << 20
"""Of address space: three times what it needs."""
_LONGEST_LABEL: Final = 40
"""Of an instance's name, with room for the number that a conflict adds (RFC 6763 9); 63 are allowed."""


def service(
    advertisement: Advertisement, port: int, addresses: tuple[str, ...], host: str = ""
) -> ServiceInfo:
    """Returns the records of a gateway.

    Args:
        advertisement: for the TXT record.
        port: of the gateway.
        addresses: of the gateway.
        host: another name than this machine's, whose records may have another owner (Avahi, for example).
    """
    own = plain_name(socket.gethostname().partition(".")[0], _LONGEST_LABEL)
    host = host or f"{own}-robot-gateway"
    return ServiceInfo(
        SERVICE_TYPE,
        f"{plain_name(advertisement.name, _LONGEST_LABEL)}.{SERVICE_TYPE}",
        port=port,
        properties=advertisement.properties(),
        server=f"{host}.local.",
        parsed_addresses=list(addresses),
    )


def run(advertisement: Advertisement, port: int, host: str, only: tuple[str, ...]) -> None:
    """Advertises until SIGTERM, or until the machine's addresses change.

    Args:
        advertisement: what is announced.
        port: of the gateway.
        host: `grpc.host` of the gateway.
        only: `discovery.addresses`.

    Raises:
        OSError: there is no network to do it on.
    """
    addresses = advertised_addresses(host, only)
    if not addresses:
        raise OSError("no address of this machine to advertise")
    # Multicast is sent by one of the families: machines with IPv6 only are the exception.
    bound = [each for each in addresses if ":" not in each] or list(addresses)
    zeroconf = Zeroconf(interfaces=bound)
    try:
        zeroconf.register_service(service(advertisement, port, addresses), allow_name_change=True)
        print("advertised", flush=True)
        signals = {signal.SIGTERM, signal.SIGINT}
        while advertised_addresses(host, only) == addresses:
            if signal.sigtimedwait(signals, _LOOK_EVERY_S):
                return
    finally:
        # Says goodbye (RFC 6762 10.1).
        zeroconf.close()


def _main() -> None:
    parent, text = sys.argv[1:]
    end_with_parent(int(parent))
    # Before threads start, which inherit it: the signals are waited for.
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM, signal.SIGINT})
    os.nice(_LOWEST_PRIORITY)
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY_BYTES, _MEMORY_BYTES))
    given: dict[str, Any] = json.loads(text)
    announced = Advertisement(given["name"], given["contract"], given["tls"])
    try:
        run(announced, given["port"], given["host"], tuple(given["only"]))
    except OSError as error:
        sys.exit(str(error))


if __name__ == "__main__":
    _main()
