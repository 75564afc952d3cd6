"""Makes the keys of a cluster: an authority, and a certificate by which its programs know one another."""

import os
from datetime import UTC, datetime, timedelta
from pathlib import Path

from planner.common.cluster import AUTHORITY, CERTIFICATE, KEY
from planner.common.errors import InputError, MissingProgramError
from planner.common.files import write_together


def make_cluster_keys(folder: Path) -> list[Path]:
    """Make a folder of keys, and return its files; who has it may run what they like on the cluster.

    The key of the authority is not kept: nobody makes a further certificate. New keys are made all together.

    Raises:
        InputError: the folder has keys already, or cannot be written.
        MissingProgramError: the package cryptography is not installed.
    """
    if any((folder / name).exists() for name in (AUTHORITY, CERTIFICATE, KEY)):
        raise InputError(f"{folder}: has keys already; name a new folder, or remove the old keys first")
    try:
        texts = _make_texts()
    except ImportError as err:
        raise MissingProgramError(
            "edbb serve keys needs cryptography: pip install 'edbb-planner[cluster]' installs it"
        ) from err
    try:
        folder.mkdir(parents=True, exist_ok=True)
        os.chmod(folder, 0o700)
    except OSError as err:
        raise InputError(f"{folder}: cannot be made ({err.strerror or err})") from err
    write_together([(folder / name, text) for name, text in texts.items()], own=True)
    os.chmod(folder / KEY, 0o600)
    return [folder / name for name in texts]


def _make_texts() -> dict[str, bytes]:
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import ec

    def name(text: str) -> x509.Name:
        """Return a name of one part."""
        return x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, text)])

    def certificate(subject: str, key: ec.EllipticCurvePublicKey, of_authority: bool) -> x509.Certificate:
        """Return a certificate that the authority signs."""
        made = x509.CertificateBuilder(name("edbb-planner cluster"), name(subject), key, x509.random_serial_number())
        made = made.not_valid_before(now - timedelta(days=1)).not_valid_after(now + timedelta(days=days))
        basic = x509.BasicConstraints(ca=of_authority, path_length=0 if of_authority else None)
        return made.add_extension(basic, critical=True).sign(authority, hashes.SHA256())

    days = 3650  # that the keys hold: as long as a robot is in use
    now = datetime.now(UTC)
    authority, key = ec.generate_private_key(ec.SECP256R1()), ec.generate_private_key(ec.SECP256R1())
    pem, plain = serialization.Encoding.PEM, serialization.NoEncryption()
    return {
        AUTHORITY: certificate("edbb-planner cluster", authority.public_key(), True).public_bytes(pem),
        CERTIFICATE: certificate("edbb", key.public_key(), False).public_bytes(pem),
        KEY: key.private_bytes(pem, serialization.PrivateFormat.PKCS8, plain),
    }
