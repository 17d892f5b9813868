"""A fleet's certificate authority: its own certificate and those that it signs.

Keys are on the curve P-256, which microcontrollers support, too.  Only the certificates of
coordinators and routers are valid for TLS servers, so that no robot can pose as either.  A router's
certificate is valid for a server only.  Only the authority's certificate may sign others.

Decides: what a certificate contains.  Must not know: files, who may do what.
"""

from __future__ import annotations

import datetime
import ipaddress
from collections.abc import Iterable
from typing import Final, NamedTuple

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from protocol.badge import Badge

THIS_MACHINE: Final = ("localhost", "127.0.0.1", "::1")
"""Names and addresses in every server certificate, in addition to the given hosts."""

AUTHORITY_DAYS: Final = 3_650

_EARLIER: Final = datetime.timedelta(hours=1)
"""How long before it is made a certificate becomes valid: a robot's clock may be slow."""


class Pair(NamedTuple):
    """A certificate and its private key, both PEM."""

    certificate: bytes
    private: bytes

    @property
    def expires(self) -> datetime.datetime:
        """The time (UTC) until which the certificate is valid."""
        return x509.load_pem_x509_certificate(self.certificate).not_valid_after_utc

    @property
    def serial(self) -> str:
        """The certificate's serial number, in hexadecimal digits."""
        return f"{x509.load_pem_x509_certificate(self.certificate).serial_number:x}"


def new_authority(now: datetime.datetime, days: int = AUTHORITY_DAYS) -> Pair:
    """Return a new authority that is valid for `days` days from `now` (UTC)."""
    key = ec.generate_private_key(ec.SECP256R1())
    name = _name(f"splinefleet authority {x509.random_serial_number():x}"[:64])
    usage = _usage(signs=True)
    made = (
        _begin(name, name, key, key, now, now + datetime.timedelta(days=days))
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(usage, critical=True)
        .sign(key, hashes.SHA256())
    )
    return _pair(made, key)


def new_certificate(
    authority: Pair, badge: Badge, now: datetime.datetime, days: int, hosts: Iterable[str] = ()
) -> Pair:
    """Return a certificate signed by the authority, valid for `days` days from `now` (UTC).

    It is not valid for longer than the authority's own.  `hosts` are the names and addresses under
    which a coordinator or a router can be reached.  Raises ValueError if the authority is damaged.
    """
    issuer = x509.load_pem_x509_certificate(authority.certificate)
    signer = serialization.load_pem_private_key(authority.private, password=None)
    if not isinstance(signer, ec.EllipticCurvePrivateKey):
        raise ValueError("the private key is not on an elliptic curve")
    if signer.public_key() != issuer.public_key():
        raise ValueError("the private key is not that of the certificate")
    if not _signs(issuer):
        raise ValueError("the certificate is not that of an authority")
    key = ec.generate_private_key(ec.SECP256R1())
    end = min(now + datetime.timedelta(days=days), issuer.not_valid_after_utc)
    serves = badge.role in ("coordinator", "router")
    purposes = [] if badge.role == "router" else [ExtendedKeyUsageOID.CLIENT_AUTH]
    purposes += [ExtendedKeyUsageOID.SERVER_AUTH] if serves else []
    builder = (
        _begin(issuer.subject, _name(badge.common_name), signer, key, now, end)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(_usage(signs=False), critical=True)
        .add_extension(x509.ExtendedKeyUsage(purposes), critical=False)
    )
    if serves:
        known = dict.fromkeys((*THIS_MACHINE, *hosts))
        names = x509.SubjectAlternativeName([_host(host) for host in known])
        builder = builder.add_extension(names, critical=False)
    return _pair(builder.sign(signer, hashes.SHA256()), key)


def _signs(certificate: x509.Certificate) -> bool:
    """Return whether a certificate may sign others."""
    try:
        return certificate.extensions.get_extension_for_class(x509.BasicConstraints).value.ca
    except x509.ExtensionNotFound:
        return False


def _begin(
    issuer: x509.Name,
    subject: x509.Name,
    signer: ec.EllipticCurvePrivateKey,
    key: ec.EllipticCurvePrivateKey,
    begin: datetime.datetime,
    end: datetime.datetime,
) -> x509.CertificateBuilder:
    """Return a builder with the fields of every certificate.

    It has the identifiers of both keys, because strict verifiers demand them.
    """
    own = x509.SubjectKeyIdentifier.from_public_key(key.public_key())
    whose = x509.AuthorityKeyIdentifier.from_issuer_public_key(signer.public_key())
    return (
        x509.CertificateBuilder()
        .issuer_name(issuer)
        .subject_name(subject)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(min(begin, end) - _EARLIER)
        .not_valid_after(end)
        .add_extension(own, critical=False)
        .add_extension(whose, critical=False)
    )


def _usage(*, signs: bool) -> x509.KeyUsage:
    """Return the usage of a key: to sign certificates, or to authenticate in a TLS handshake."""
    return x509.KeyUsage(
        digital_signature=not signs,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        key_cert_sign=signs,
        crl_sign=False,
        encipher_only=False,
        decipher_only=False,
    )


def _name(common_name: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common_name)])


def _host(host: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(host))
    except ValueError:
        return x509.DNSName(host)


def _pair(certificate: x509.Certificate, key: ec.EllipticCurvePrivateKey) -> Pair:
    encoding = serialization.Encoding.PEM
    private = key.private_bytes(
        encoding, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    return Pair(certificate.public_bytes(encoding), private)
