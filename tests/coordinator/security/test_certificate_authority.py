"""Certificates, read by the cryptography package and judged by openssl's own verifier."""

import datetime
import ssl

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID
from cryptography.x509.verification import PolicyBuilder, Store, VerificationError

from coordinator.security.certificate_authority import (
    AUTHORITY_DAYS,
    new_authority,
    new_certificate,
)
from protocol.badge import Badge

NOW = datetime.datetime(2026, 11, 21, 12, 0, tzinfo=datetime.UTC)
AUTHORITY = new_authority(NOW)
COORDINATOR = new_certificate(
    AUTHORITY, Badge("coordinator", "coordinator", 1), NOW, 365, ["hall.local", "192.0.2.7"]
)
ROBOT = new_certificate(AUTHORITY, Badge("robot", "R1", 3), NOW, 365)


def loaded(pair):
    return x509.load_pem_x509_certificate(pair.certificate)


def forged_by(pair):
    """Return another robot's certificate, signed with the key of a party that may not sign."""
    real = loaded(new_certificate(AUTHORITY, Badge("robot", "R2", 1), NOW, 10))
    builder = x509.CertificateBuilder(
        loaded(pair).subject,
        real.subject,
        real.public_key(),
        real.serial_number,
        real.not_valid_before_utc,
        real.not_valid_after_utc,
        list(real.extensions),
    )
    return builder.sign(serialization.load_pem_private_key(pair.private, None), hashes.SHA256())


def trusting(authority, at=NOW):
    store = Store([loaded(authority)])
    return PolicyBuilder().store(store).time(at)


def test_a_certificate_speaks_for_one_party_until_its_end():
    certificate = loaded(ROBOT)
    (name,) = certificate.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
    assert name.value == "robot/R1/3"
    assert certificate.not_valid_after_utc == ROBOT.expires == NOW + datetime.timedelta(days=365)
    assert certificate.not_valid_before_utc < NOW
    assert ROBOT.serial == f"{certificate.serial_number:x}"


@pytest.mark.parametrize("host", ["localhost", "hall.local"])
def test_the_coordinator_is_trusted_under_its_names(host):
    trusting(AUTHORITY).build_server_verifier(x509.DNSName(host)).verify(loaded(COORDINATOR), [])
    with pytest.raises(VerificationError):
        trusting(AUTHORITY).build_server_verifier(x509.DNSName("else")).verify(
            loaded(COORDINATOR), []
        )


def test_the_coordinator_is_trusted_under_its_addresses():
    names = loaded(COORDINATOR).extensions.get_extension_for_class(x509.SubjectAlternativeName)
    addresses = {str(one) for one in names.value.get_values_for_type(x509.IPAddress)}
    assert addresses == {"127.0.0.1", "::1", "192.0.2.7"}


def test_a_robot_can_serve_no_link_and_sign_no_certificate():
    extensions = loaded(ROBOT).extensions
    usage = extensions.get_extension_for_class(x509.ExtendedKeyUsage).value
    assert list(usage) == [ExtendedKeyUsageOID.CLIENT_AUTH]
    assert not extensions.get_extension_for_class(x509.BasicConstraints).value.ca
    assert not extensions.get_extension_for_class(x509.KeyUsage).value.key_cert_sign
    with pytest.raises(ValueError, match="the certificate is not that of an authority"):
        new_certificate(ROBOT, Badge("robot", "R2", 1), NOW, 10)
    with pytest.raises(VerificationError):
        trusting(AUTHORITY).build_client_verifier().verify(forged_by(ROBOT), [loaded(ROBOT)])


def test_a_certificate_that_does_not_say_what_it_may_do_is_no_authority():
    key = serialization.load_pem_private_key(AUTHORITY.private, None)
    real = loaded(AUTHORITY)
    bare = x509.CertificateBuilder(
        real.issuer,
        real.subject,
        real.public_key(),
        real.serial_number,
        real.not_valid_before_utc,
        real.not_valid_after_utc,
    ).sign(key, hashes.SHA256())
    pem = bare.public_bytes(serialization.Encoding.PEM)
    with pytest.raises(ValueError, match="the certificate is not that of an authority"):
        new_certificate(AUTHORITY._replace(certificate=pem), Badge("robot", "R2", 1), NOW, 10)


def test_a_routers_key_serves_a_link_under_its_names_and_opens_none():
    pair = new_certificate(AUTHORITY, Badge("router", "router", 1), NOW, 365, ["router.local"])
    usage = loaded(pair).extensions.get_extension_for_class(x509.ExtendedKeyUsage).value
    assert list(usage) == [ExtendedKeyUsageOID.SERVER_AUTH]
    server = trusting(AUTHORITY).build_server_verifier(x509.DNSName("router.local"))
    server.verify(loaded(pair), [])
    with pytest.raises(VerificationError):
        trusting(AUTHORITY).build_client_verifier().verify(loaded(pair), [])


def test_a_robot_of_another_authority_is_not_of_this_one():
    other = new_certificate(new_authority(NOW), Badge("robot", "R1", 3), NOW, 365)
    with pytest.raises(ValueError, match="does not match"):
        loaded(other).verify_directly_issued_by(loaded(AUTHORITY))
    loaded(ROBOT).verify_directly_issued_by(loaded(AUTHORITY))


def test_no_certificate_outlives_its_authority():
    late = NOW + datetime.timedelta(days=AUTHORITY_DAYS - 10)
    assert (
        new_certificate(AUTHORITY, Badge("robot", "R1", 1), late, 365).expires == AUTHORITY.expires
    )


def test_two_certificates_share_neither_key_nor_number():
    again = new_certificate(AUTHORITY, Badge("robot", "R1", 3), NOW, 365)
    assert again.private != ROBOT.private
    assert again.serial != ROBOT.serial


def test_the_strict_checks_of_openssl_take_both(tmp_path):
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    for name, content in (("c", COORDINATOR.certificate), ("p", COORDINATOR.private)):
        (tmp_path / name).write_bytes(content)
    context.load_cert_chain(tmp_path / "c", tmp_path / "p")
    extensions = {extension.oid for extension in loaded(ROBOT).extensions}
    assert x509.AuthorityKeyIdentifier.oid in extensions
    assert x509.SubjectKeyIdentifier.oid in extensions
