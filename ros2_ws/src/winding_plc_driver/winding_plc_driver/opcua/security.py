"""Certificates and keys of the channel, as the mapping names them."""

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
    for path in filter(None, (server.certificate, server.private_key, server.server_certificate)):
        if not Path(path).is_file():
            raise ua.UaError(f"{path} is not a file")
    certificate = await uacrypto.load_certificate(server.certificate)
    client.application_uri = _application_uri(certificate) or client.application_uri
    await client.set_security(
        getattr(security_policies, f"SecurityPolicy{server.security_policy}"),
        server.certificate,
        server.private_key,
        server_certificate=server.server_certificate or None,
        mode=ua.MessageSecurityMode[server.security_mode],
    )


def _application_uri(certificate: x509.Certificate) -> str:
    """Return the URI that a certificate is made out to, which a server compares; empty for none."""
    try:
        names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName)
    except x509.ExtensionNotFound:
        return ""
    uris = names.value.get_values_for_type(x509.UniformResourceIdentifier)
    return uris[0] if uris else ""
