"""Certificates are what TLS asks for: who signed, for whom, for what, how long."""

import time

import pytest
from cryptography import x509
from cryptography.x509.oid import ExtendedKeyUsageOID
from cryptography.x509.verification import PolicyBuilder, Store, VerificationError

from common.errors import UserError
from gateway.access.authority import (
    belongs_together,
    certificate_facts,
    client_certificate,
    new_authority,
    server_certificate,
)

DAY_S = 86_400
AUTHORITY = new_authority("lab", 100)


def loaded(pem: bytes) -> x509.Certificate:
    return x509.load_pem_x509_certificate(pem)


def test_a_server_certificate_stands_up_to_a_strict_verifier() -> None:
    pair = server_certificate(AUTHORITY, "lab", ("lab.local", "10.0.0.5"), 50)
    verifier = (
        PolicyBuilder()
        .store(Store([loaded(AUTHORITY.certificate)]))
        .build_server_verifier(x509.DNSName("lab.local"))
    )
    assert verifier.verify(loaded(pair.certificate), [])
    facts = certificate_facts(pair.certificate)
    assert facts.hosts == ("lab.local", "10.0.0.5")
    assert facts.ends_s - time.time() == pytest.approx(50 * DAY_S, abs=60)
    assert facts.begins_s - time.time() == pytest.approx(-DAY_S, abs=60)


def test_another_authority_verifies_nothing() -> None:
    pair = server_certificate(new_authority("lab", 100), "lab", ("lab.local",), 50)
    verifier = (
        PolicyBuilder()
        .store(Store([loaded(AUTHORITY.certificate)]))
        .build_server_verifier(x509.DNSName("lab.local"))
    )
    with pytest.raises(VerificationError):
        verifier.verify(loaded(pair.certificate), [])


def test_a_client_certificate_is_no_servers_and_the_other_way_round() -> None:
    def uses(pem: bytes) -> list[x509.ObjectIdentifier]:
        return list(loaded(pem).extensions.get_extension_for_class(x509.ExtendedKeyUsage).value)

    client = client_certificate(AUTHORITY, "anna", 10)
    server = server_certificate(AUTHORITY, "lab", ("lab.local",), 10)
    assert uses(client.certificate) == [ExtendedKeyUsageOID.CLIENT_AUTH]
    assert uses(server.certificate) == [ExtendedKeyUsageOID.SERVER_AUTH]


def test_nothing_outlives_the_authority() -> None:
    pair = client_certificate(AUTHORITY, "anna", 1000)
    assert certificate_facts(pair.certificate).ends_s == certificate_facts(AUTHORITY.certificate).ends_s


def test_keys_are_their_certificates_and_in_no_repr() -> None:
    one, other = client_certificate(AUTHORITY, "anna", 1), client_certificate(AUTHORITY, "anna", 1)
    assert belongs_together(one)
    assert not belongs_together(type(one)(one.certificate, other.key))
    assert "PRIVATE" not in repr(one)


def test_a_host_that_is_none_is_one_line() -> None:
    with pytest.raises(UserError, match="neither a host name nor an address"):
        server_certificate(AUTHORITY, "lab", ("läb",), 1)
