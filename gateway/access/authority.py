"""The robot's own certificate authority: the only place that knows `cryptography`.

Every robot has one of its own, so that nothing made for one robot opens another. Keys are on the curve P-256:
a handshake with them takes an SBC a millisecond or two.
"""

import ipaddress
from collections.abc import Iterable
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from typing import Final

from cryptography import x509
from cryptography.exceptions import UnsupportedAlgorithm
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from common.errors import UserError

_BEGINS_EARLIER: Final = timedelta(days=1)
"""Certificates are valid from a day before they are made: the laptop's clock is another one."""
_LONGEST_NAME: Final = 64
_TO_SIGN: Final = ("digital_signature",)
_TO_CERTIFY: Final = ("key_cert_sign", "crl_sign")
_USES: Final = (
    "digital_signature",
    "content_commitment",
    "key_encipherment",
    "data_encipherment",
    "key_agreement",
    "key_cert_sign",
    "crl_sign",
    "encipher_only",
    "decipher_only",
)


@dataclass(frozen=True, slots=True)
class Pair:
    """A certificate and its key, as PEM. The key is not in the `repr`."""

    certificate: bytes
    key: bytes = field(repr=False)


@dataclass(frozen=True, slots=True)
class CertificateFacts:
    """What is read from a certificate.

    Attributes:
        fingerprint: SHA-256 of its DER form, as hexadecimal digits.
        begins_s: seconds since 1970 (UTC).
        ends_s: seconds since 1970 (UTC).
        hosts: names and addresses that it is good for.
    """

    fingerprint: str
    begins_s: int
    ends_s: int
    hosts: tuple[str, ...]


def new_authority(name: str, days: float) -> Pair:
    """A certificate authority for one robot.

    Args:
        name: of the robot.
        days: how long it is valid.
    """
    key = ec.generate_private_key(ec.SECP256R1())
    subject = _named(f"{name} authority")
    builder = _begun(subject, subject, key, days, uses=_TO_CERTIFY).add_extension(
        x509.BasicConstraints(ca=True, path_length=0), critical=True
    )
    return _signed(builder, key, key)


def server_certificate(authority: Pair, name: str, hosts: Iterable[str], days: float) -> Pair:
    """What the gateway shows to whoever connects.

    Args:
        authority: who signs.
        name: of the robot.
        hosts: names and addresses by which it is called.
        days: how long it is valid.
    """
    alternatives = x509.SubjectAlternativeName([_alternative(host) for host in hosts])
    return _issued(authority, name, days, ExtendedKeyUsageOID.SERVER_AUTH, alternatives)


def client_certificate(authority: Pair, name: str, days: float) -> Pair:
    """What somebody shows to the gateway.

    Args:
        authority: who signs.
        name: of the person or the program.
        days: how long it is valid.
    """
    return _issued(authority, name, days, ExtendedKeyUsageOID.CLIENT_AUTH, None)


def certificate_facts(pem: bytes) -> CertificateFacts:
    """What the first certificate in a file says.

    Raises:
        ValueError: there is none.
    """
    certificate = x509.load_pem_x509_certificate(pem)
    try:
        found = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
        names = [*found.get_values_for_type(x509.DNSName)]
        addresses = [str(each) for each in found.get_values_for_type(x509.IPAddress)]
    except x509.ExtensionNotFound:
        names, addresses = [], []
    return CertificateFacts(
        fingerprint=certificate.fingerprint(hashes.SHA256()).hex(),
        begins_s=int(certificate.not_valid_before_utc.timestamp()),
        ends_s=int(certificate.not_valid_after_utc.timestamp()),
        hosts=(*names, *addresses),
    )


def belongs_together(pair: Pair) -> bool:
    """Whether the key is the certificate's.

    Raises:
        ValueError: one of them can't be read, or the key has a password.
    """
    try:
        certificate = x509.load_pem_x509_certificate(pair.certificate)
        key = serialization.load_pem_private_key(pair.key, password=None)
        return key.public_key() == certificate.public_key()
    except (TypeError, UnsupportedAlgorithm) as error:
        raise ValueError(str(error)) from error


def _issued(
    authority: Pair,
    name: str,
    days: float,
    purpose: x509.ObjectIdentifier,
    alternatives: x509.SubjectAlternativeName | None,
) -> Pair:
    issuer = x509.load_pem_x509_certificate(authority.certificate)
    issuer_key = serialization.load_pem_private_key(authority.key, password=None)
    assert isinstance(issuer_key, ec.EllipticCurvePrivateKey), "our own authorities have no other keys"
    key = ec.generate_private_key(ec.SECP256R1())
    builder = (
        _begun(_named(name), issuer.subject, key, days, uses=_TO_SIGN, not_after=issuer.not_valid_after_utc)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(x509.ExtendedKeyUsage([purpose]), critical=False)
        .add_extension(
            x509.AuthorityKeyIdentifier.from_issuer_public_key(issuer_key.public_key()), critical=False
        )
    )
    if alternatives is not None:
        builder = builder.add_extension(alternatives, critical=False)
    return _signed(builder, key, issuer_key)


def _begun(
    subject: x509.Name,
    issuer: x509.Name,
    key: ec.EllipticCurvePrivateKey,
    days: float,
    *,
    uses: tuple[str, ...],
    not_after: datetime | None = None,
) -> x509.CertificateBuilder:
    now = datetime.now(UTC)
    end = now + timedelta(days=days)
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        # One that is over already, which tests make, still has to begin before it ends.
        .not_valid_before(min(now, end) - _BEGINS_EARLIER)
        .not_valid_after(min(end, not_after) if not_after else end)
        .add_extension(x509.KeyUsage(**{use: use in uses for use in _USES}), critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
    )


def _signed(
    builder: x509.CertificateBuilder, key: ec.EllipticCurvePrivateKey, signer: ec.EllipticCurvePrivateKey
) -> Pair:
    certificate = builder.sign(signer, hashes.SHA256())
    return Pair(
        certificate.public_bytes(serialization.Encoding.PEM),
        key.private_bytes(
            serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
        ),
    )


def _named(name: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name[:_LONGEST_NAME])])


def _alternative(host: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(host))
    except ValueError:
        pass
    try:
        return x509.DNSName(host)
    except ValueError as error:
        raise UserError(f"'{host}' is neither a host name nor an address", "Name hosts in ASCII") from error
