"""`security`: authentication, encryption and the audit log."""

from pathlib import Path
from typing import Self

from pydantic import Field, model_validator

from common.config import Section
from gateway.access.directory import CredentialDirectory
from gateway.access.reloader import TlsFiles


class TlsSettings(Section):
    """Encryption of the connections; applies if there are credentials."""

    enabled: bool = True
    """False sends tokens and responses unencrypted: for loopback only, behind a tunnel."""
    certificate: Path | None = None
    """Server certificate (PEM, with its chain); by default the one of the credentials."""
    key: Path | None = None
    """Private key of the certificate (PEM, mode 0600)."""
    client_certificates: bool = False
    """Whether every caller must present a certificate."""
    client_ca: Path | None = None
    """CA of the client certificates (PEM); by default the one of the credentials."""

    @model_validator(mode="after")
    def _keep_pairs(self) -> Self:
        if (self.certificate is None) != (self.key is None):
            raise ValueError("certificate and key belong together: name both, or neither")
        if self.client_certificates and not self.enabled:
            raise ValueError("client_certificates need TLS: leave enabled at true")
        return self


class AuditSettings(Section):
    """The audit log of control actions; they are in the program's log as well."""

    file: Path | None = None
    """JSON lines; by default audit.jsonl beside the credentials, none without credentials."""
    max_kib: int = Field(default=1024, ge=4, le=1_048_576)
    """Size at which the file, and the one of refused actions beside it, is rotated."""
    generations: int = Field(default=4, ge=1, le=100)
    """How many of each are kept, the newest included."""


class SecuritySettings(Section):
    """Who may call the gateway."""

    insecure: bool = False
    """Accepts that others on the network can eavesdrop and, without credentials, control everything."""
    credentials: Path | None = None
    """Directory made by `robot-gateway credentials init`; with it, every caller must authenticate."""
    tls: TlsSettings = TlsSettings()
    audit: AuditSettings = AuditSettings()

    @property
    def guarded(self) -> bool:
        """Whether callers are authenticated and connections encrypted."""
        return self.credentials is not None and self.tls.enabled

    def access_files(self) -> tuple[CredentialDirectory, TlsFiles | None] | None:
        """Returns where credentials and certificates are; None if callers are not authenticated.

        The certificates are those named here, else those of the directory, where the robot's CA must have
        issued the gateway's; None without TLS.
        """
        if self.credentials is None:
            return None
        files, tls = CredentialDirectory(self.credentials), self.tls
        if not tls.enabled:
            return files, None
        client_ca = (tls.client_ca or files.ca.certificate) if tls.client_certificates else None
        own = files.server
        certificate = tls.certificate or own.certificate
        issuer = files.ca.certificate if certificate == own.certificate else None
        return files, TlsFiles(certificate, tls.key or own.key, client_ca, issuer)

    @model_validator(mode="after")
    def _need_credentials(self) -> Self:
        tls = self.tls
        if self.credentials is None and (tls.certificate or tls.client_certificates or tls.client_ca):
            raise ValueError("tls alone authenticates no one: name the directory of the credentials, too")
        return self
