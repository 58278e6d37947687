"""Certificate authorities (CA) of robots and hubs.

Each robot has its own CA, and so has each hub, so that no certificate of one is valid on another. Keys are on
the curve P-256, with which a handshake takes an SBC a millisecond or two.
"""

import ipaddress
from collections.abc import Iterable
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from typing import Final

from cryptography import x509
from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from common.errors import UserError

_BACKDATED: Final = timedelta(days=1)
"""Certificates are valid from a day before their issue, because the laptop's clock may differ."""
_MAX_COMMON_NAME: Final = 64
"""ub-common-name of RFC 5280, appendix A.1."""
_MALFORMED: Final = (
    UnsupportedAlgorithm,
    x509.DuplicateExtension,
    x509.InvalidVersion,
    x509.UnsupportedGeneralNameType,
)
"""What the parser raises besides ValueError; some of it only when extensions are read."""
_KEY_USAGES: Final = (
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
class KeyPair:
    """A certificate and its private key as PEM; the key is excluded from the `repr`."""

    certificate: bytes
    key: bytes = field(repr=False)


@dataclass(frozen=True, slots=True)
class CertificateInfo:
    """Contents of a certificate.

    Attributes:
        fingerprint: SHA-256 of its DER encoding, as hexadecimal digits.
        ends_s: end of validity (notAfter), seconds since 1970 (UTC).
        hosts: DNS names and IP addresses in its subjectAltName.
    """

    fingerprint: str
    ends_s: int
    hosts: tuple[str, ...]


def new_ca(name: str, days: float) -> KeyPair:
    """Creates a CA for the robot of this name, valid for `days`."""
    constraints = x509.BasicConstraints(ca=True, path_length=0)
    return _issue(None, f"{name} authority", days, constraints, _key_usage("key_cert_sign", "crl_sign"))


def issue_server_certificate(ca: KeyPair, name: str, hosts: Iterable[str], days: float) -> KeyPair:
    """Issues the certificate that the gateway presents to clients.

    Args:
        ca: the issuer.
        name: of the robot.
        hosts: DNS names and IP addresses that clients connect to; they match these alone (RFC 9525).
        days: of validity, at most that of the CA.

    Raises:
        UserError: a host is neither a name nor an address.
    """
    names = x509.SubjectAlternativeName([_general_name(host) for host in hosts])
    return _issue_leaf(ca, name, days, (ExtendedKeyUsageOID.SERVER_AUTH,), names)


def issue_node_certificate(ca: KeyPair, name: str, hosts: Iterable[str], days: float) -> KeyPair:
    """Issues the certificate of a cluster's node: it is a server to clients, and both to other nodes.

    Raises:
        UserError: a host is neither a name nor an address.
    """
    names = x509.SubjectAlternativeName([_general_name(host) for host in hosts])
    return _issue_leaf(
        ca, name, days, (ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH), names
    )


def issue_client_certificate(ca: KeyPair, name: str, days: float) -> KeyPair:
    """Issues the certificate that a person or program of this name presents to the gateway."""
    return _issue_leaf(ca, name, days, (ExtendedKeyUsageOID.CLIENT_AUTH,))


def certificate_info(pem: bytes) -> CertificateInfo:
    """Parses the first certificate of a PEM file.

    Raises:
        ValueError: it contains none that is well-formed.
    """
    hosts: list[str] = []
    try:
        certificate = x509.load_pem_x509_certificate(pem)
        names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
        hosts += names.get_values_for_type(x509.DNSName)
        hosts += map(str, names.get_values_for_type(x509.IPAddress))
    except x509.ExtensionNotFound:
        pass
    except _MALFORMED as error:
        raise ValueError(str(error)) from error
    return CertificateInfo(
        fingerprint=certificate.fingerprint(hashes.SHA256()).hex(),
        ends_s=int(certificate.not_valid_after_utc.timestamp()),
        hosts=tuple(hosts),
    )


def key_matches(pair: KeyPair) -> bool:
    """Returns whether the private key belongs to the certificate.

    Raises:
        ValueError: one of them can't be parsed, or the key is encrypted.
    """
    try:
        certificate = x509.load_pem_x509_certificate(pair.certificate)
        key = serialization.load_pem_private_key(pair.key, password=None)
        return key.public_key() == certificate.public_key()
    except (TypeError, *_MALFORMED) as error:
        raise ValueError(str(error)) from error


def is_issued_by(certificate: bytes, authority: bytes) -> bool:
    """Returns whether the authority has signed the certificate; both are the first of a PEM file.

    Raises:
        ValueError: one of them can't be parsed.
    """
    try:
        issued, issuer = (x509.load_pem_x509_certificate(each) for each in (certificate, authority))
    except _MALFORMED as error:
        raise ValueError(str(error)) from error
    try:
        issued.verify_directly_issued_by(issuer)
    except (InvalidSignature, TypeError, ValueError):
        # Another key, a key that signs nothing, another name.
        return False
    return True


def _issue_leaf(
    ca: KeyPair,
    name: str,
    days: float,
    purposes: tuple[x509.ObjectIdentifier, ...],
    *extensions: x509.ExtensionType,
) -> KeyPair:
    constraints = x509.BasicConstraints(ca=False, path_length=None)
    usage = _key_usage("digital_signature")
    return _issue(ca, name, days, constraints, usage, x509.ExtendedKeyUsage(purposes), *extensions)


def _issue(ca: KeyPair | None, name: str, days: float, *extensions: x509.ExtensionType) -> KeyPair:
    """Issues a certificate for a new key; without `ca` it is self-signed."""
    key = ec.generate_private_key(ec.SECP256R1())
    issuer = subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name[:_MAX_COMMON_NAME])])
    issuer_key, now = key, datetime.now(UTC)
    not_after = now + timedelta(days=days)
    if ca is not None:
        certificate = x509.load_pem_x509_certificate(ca.certificate)
        signing_key = serialization.load_pem_private_key(ca.key, password=None)
        # The robot's own CA has no other keys.
        assert isinstance(signing_key, ec.EllipticCurvePrivateKey)  # noqa: S101  # narrows cryptography's union
        issuer, issuer_key = certificate.subject, signing_key
        not_after = min(not_after, certificate.not_valid_after_utc)
    builder = (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        # An expired certificate, as tests issue, must still begin before it ends.
        .not_valid_before(min(now, not_after) - _BACKDATED)
        .not_valid_after(not_after)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
    )
    if ca is not None:
        key_id = x509.AuthorityKeyIdentifier.from_issuer_public_key(issuer_key.public_key())
        builder = builder.add_extension(key_id, critical=False)
    for extension in extensions:
        # Both restrict what the certificate is valid for, so RFC 5280 4.2.1.3 and 4.2.1.9 want them critical.
        critical = isinstance(extension, x509.BasicConstraints | x509.KeyUsage)
        builder = builder.add_extension(extension, critical=critical)
    return KeyPair(
        builder.sign(issuer_key, hashes.SHA256()).public_bytes(serialization.Encoding.PEM),
        key.private_bytes(
            serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
        ),
    )


def _key_usage(*usages: str) -> x509.KeyUsage:
    return x509.KeyUsage(**{each: each in usages for each in _KEY_USAGES})


def _general_name(host: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(host))
    except ValueError:
        pass
    try:
        return x509.DNSName(host)
    except ValueError as error:
        raise UserError(f"'{host}' is neither a host name nor an address", "Write hosts in ASCII") from error
