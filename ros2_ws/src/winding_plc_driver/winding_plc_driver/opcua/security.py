"""Certificates and keys of channel and user, as the mapping names them."""

from __future__ import annotations

from pathlib import Path

from asyncua import Client, ua
from asyncua.crypto import security_policies, uacrypto
from cryptography import x509

from winding_plc_driver.machine.mapping import Server


async def secure(client: Client, server: Server) -> None:
    """Set a client's security policy; without one, nothing.

    Raises:
        UaError: A file cannot be read, or the server offers no such policy and mode.
        OSError: The server cannot be reached.
    """
    if server.security_policy == "None":
        return
    _check_files(server.certificate, server.private_key, server.server_certificate)
    certificate = await uacrypto.load_certificate(server.certificate)
    client.application_uri = _application_uri(certificate) or client.application_uri
    await client.set_security(
        getattr(security_policies, f"SecurityPolicy{server.security_policy}"),
        server.certificate,
        server.private_key,
        server_certificate=server.server_certificate or None,
        mode=ua.MessageSecurityMode[server.security_mode],
    )


async def identify(client: Client, server: Server) -> None:
    """Give a client the certificate of its user; without one, nothing.

    Raises:
        UaError: There is no such file.
        ValueError: A file holds no certificate, or no key.
    """
    if server.user_certificate:
        _check_files(server.user_certificate, server.user_private_key)
        await client.load_client_certificate(server.user_certificate)
        await client.load_private_key(Path(server.user_private_key))


def _check_files(*paths: str) -> None:
    for path in filter(None, paths):
        if not Path(path).is_file():
            raise ua.UaError(f"{path} is not a file")


def _application_uri(certificate: x509.Certificate) -> str:
    """Return the URI that a certificate is made out to, which a server compares; empty for none."""
    try:
        names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName)
    except x509.ExtensionNotFound:
        return ""
    uris = names.value.get_values_for_type(x509.UniformResourceIdentifier)
    return uris[0] if uris else ""
