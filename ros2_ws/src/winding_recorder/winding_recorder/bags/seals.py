"""SHA-256 of every file of a recording, in the format of `sha256sum`.

The CRCs of MCAP leave bytes uncovered: the length of a record outside chunks may change into
another that still parses, and metadata.yaml has no checksum at all. The seal covers every byte of
every file, and the seal itself is compared byte by byte.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path

SEAL = "checksums.sha256"


def digest_of(path: Path) -> str:
    """Return the SHA-256 of a file in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def seal_text(digests: Mapping[str, str]) -> str:
    """Return the content of the seal for digests by file name."""
    return "".join(f"{digest}  {name}\n" for name, digest in sorted(digests.items()))


def seal_findings(folder: Path) -> list[str]:
    """Return what speaks against the files of a sealed folder, one sentence each."""
    digests = {
        path.name: digest_of(path)
        for path in folder.iterdir()
        if path.is_file() and path.name != SEAL
    }
    sealed = (folder / SEAL).read_bytes()
    if sealed == seal_text(digests).encode():
        return []
    known: dict[str, str] = {}
    for line in sealed.decode("utf-8", errors="replace").splitlines():
        digest, _, name = line.partition("  ")
        known[name] = digest
    findings = [
        f"{name}: its bytes are not those that were recorded (SHA-256 differs)"
        for name, digest in sorted(digests.items())
        if name in known and known[name] != digest
    ]
    findings += [f"{name}: not in {SEAL}" for name in sorted(digests.keys() - known.keys())]
    findings += [f"{name}: in {SEAL}, but gone" for name in sorted(known.keys() - digests.keys())]
    return findings or [f"{SEAL}: its bytes are not those that were written"]
