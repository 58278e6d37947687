"""TLS for operators: the next connection is shown the newest certificate, and nobody is cut off."""

import grpc

from gateway.access.reloader import TlsMaterial


class ServerTls:
    """What connections are encrypted with. `use` may be called from any thread.

    Python's gRPC either insists on a client's certificate or asks for none: with an authority for clients,
    every caller must show one that it has signed.

    Args:
        material: to begin with. Whether there is an authority for clients can't change later.
    """

    def __init__(self, material: TlsMaterial) -> None:
        self._insists = material.client_ca is not None
        self._configuration = self._given = _configuration(material)

    def use(self, material: TlsMaterial) -> None:
        """Connections from now on are made with this; those that exist go on as they are."""
        self._configuration = _configuration(material)

    def credentials(self) -> grpc.ServerCredentials:
        """For the server. gRPC's own threads ask for the newest at each handshake."""
        return grpc.dynamic_ssl_server_credentials(
            self._configuration,
            self._newest,  # type: ignore[arg-type]  # None is documented, and missing in the stubs
            self._insists,
        )

    def _newest(self) -> grpc.ServerCertificateConfiguration | None:
        """None where nothing has changed: gRPC would read keys and certificates anew for every connection."""
        newest = self._configuration
        if newest is self._given:
            return None
        self._given = newest
        return newest


def _configuration(material: TlsMaterial) -> grpc.ServerCertificateConfiguration:
    server = material.server
    return grpc.ssl_server_certificate_configuration(
        [(server.key, server.certificate)], root_certificates=material.client_ca
    )
