"""TLS for operators: new connections get the newest certificate, and existing ones continue."""

import grpc

from gateway.access.reloader import TlsMaterial


class ServerTls:
    """Certificates and keys of the server, replaceable while it runs. `use` may be called from any thread.

    gRPC for Python either requires a client certificate or requests none: with a CA for clients, every caller
    must present one that it has signed.

    Args:
        material: the initial one. Whether it has a CA for clients can't change later.
    """

    def __init__(self, material: TlsMaterial) -> None:
        self._requires_client = material.client_ca is not None
        self._configuration = self._given = _configuration(material)

    def use(self, material: TlsMaterial) -> None:
        """Replaces what new connections use."""
        self._configuration = _configuration(material)

    def credentials(self) -> grpc.ServerCredentials:
        """Returns the server's credentials; gRPC's own threads request the newest at each handshake."""
        return grpc.dynamic_ssl_server_credentials(
            self._configuration,
            self._newest,  # type: ignore[arg-type]  # None is documented, and missing in the stubs
            self._requires_client,
        )

    def _newest(self) -> grpc.ServerCertificateConfiguration | None:
        """Returns None if nothing has changed: gRPC would otherwise parse all of it for every connection."""
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
