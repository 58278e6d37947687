"""Certificates have the issuer, names, purposes and validity that TLS verifies."""

import ssl
import time
from datetime import UTC, datetime, timedelta

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID
from cryptography.x509.verification import PolicyBuilder, Store, VerificationError

from common.ca import (
    KeyPair,
    certificate_info,
    is_issued_by,
    issue_client_certificate,
    issue_server_certificate,
    key_matches,
    new_ca,
)
from common.errors import UserError

DAY_S = 86_400
CA = new_ca("lab", 100)


def loaded(pem: bytes) -> x509.Certificate:
    return x509.load_pem_x509_certificate(pem)


def test_a_server_certificate_stands_up_to_a_strict_verifier() -> None:
    pair = issue_server_certificate(CA, "lab", ("lab.local", "10.0.0.5"), 50)
    verifier = (
        PolicyBuilder()
        .store(Store([loaded(CA.certificate)]))
        .build_server_verifier(x509.DNSName("lab.local"))
    )
    assert verifier.verify(loaded(pair.certificate), [])
    info = certificate_info(pair.certificate)
    assert info.hosts == ("lab.local", "10.0.0.5")
    assert info.ends_s - time.time() == pytest.approx(50 * DAY_S, abs=60)
    begins_s = loaded(pair.certificate).not_valid_before_utc.timestamp()
    assert begins_s - time.time() == pytest.approx(-DAY_S, abs=60)


def test_another_ca_verifies_nothing() -> None:
    pair = issue_server_certificate(new_ca("lab", 100), "lab", ("lab.local",), 50)
    verifier = (
        PolicyBuilder()
        .store(Store([loaded(CA.certificate)]))
        .build_server_verifier(x509.DNSName("lab.local"))
    )
    with pytest.raises(VerificationError):
        verifier.verify(loaded(pair.certificate), [])


def test_client_and_server_certificates_are_not_interchangeable() -> None:
    def uses(pem: bytes) -> list[x509.ObjectIdentifier]:
        return list(loaded(pem).extensions.get_extension_for_class(x509.ExtendedKeyUsage).value)

    client = issue_client_certificate(CA, "anna", 10)
    server = issue_server_certificate(CA, "lab", ("lab.local",), 10)
    assert uses(client.certificate) == [ExtendedKeyUsageOID.CLIENT_AUTH]
    assert uses(server.certificate) == [ExtendedKeyUsageOID.SERVER_AUTH]


def test_nothing_outlives_the_ca() -> None:
    pair = issue_client_certificate(CA, "anna", 1000)
    assert certificate_info(pair.certificate).ends_s == certificate_info(CA.certificate).ends_s


def test_keys_match_their_certificates_and_are_in_no_repr() -> None:
    one, other = issue_client_certificate(CA, "anna", 1), issue_client_certificate(CA, "anna", 1)
    assert key_matches(one)
    assert not key_matches(type(one)(one.certificate, other.key))
    assert "PRIVATE" not in repr(one)


def test_an_issuer_is_known_by_its_key_and_not_by_its_name() -> None:
    issued = issue_server_certificate(CA, "lab", ("lab.local",), 1).certificate
    assert is_issued_by(issued, CA.certificate)
    assert not is_issued_by(issued, new_ca("lab", 1).certificate)
    assert not is_issued_by(issued, new_ca("other", 1).certificate)
    with pytest.raises(ValueError, match="PEM"):
        is_issued_by(issued, b"damaged")


def test_an_invalid_host_is_one_line() -> None:
    with pytest.raises(UserError, match="neither a host name nor an address"):
        issue_server_certificate(CA, "lab", ("läb",), 1)


def test_a_malformed_certificate_is_refused_as_such() -> None:
    """An extension twice, which is noticed when extensions are read, and an unknown version (RFC 5280 4)."""
    oid = x509.ObjectIdentifier("2.5.29.99")
    key, name = ec.generate_private_key(ec.SECP256R1()), x509.Name([])
    now = datetime.now(UTC)
    certificate = (
        x509.CertificateBuilder(name, name, key.public_key(), 1, now, now + timedelta(days=1))
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
        .add_extension(x509.UnrecognizedExtension(oid, b"\x04\x00"), critical=False)
        .sign(key, hashes.SHA256())
    )
    der = certificate.public_bytes(serialization.Encoding.DER)
    twice = der.replace(b"\x06\x03\x55\x1d\x63", b"\x06\x03\x55\x1d\x0e")
    unknown = der.replace(b"\xa0\x03\x02\x01\x02", b"\xa0\x03\x02\x01\x22")
    assert certificate_info(ssl.DER_cert_to_PEM_cert(der).encode())
    for malformed in (twice, unknown):
        assert malformed != der
        with pytest.raises(ValueError, match=r"Duplicate|version"):
            certificate_info(ssl.DER_cert_to_PEM_cert(malformed).encode())
    with pytest.raises(ValueError, match="version"):
        key_matches(KeyPair(ssl.DER_cert_to_PEM_cert(unknown).encode(), CA.key))
