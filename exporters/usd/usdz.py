"""Checks of the archive of a .usdz file.

https://openusd.org/release/spec_usdz.html
"""

from __future__ import annotations

import struct
import zipfile
import zlib
from pathlib import Path, PurePosixPath

from exporters.findings import Finding

LAYERS = (".usd", ".usda", ".usdc")
ALLOWED = (*LAYERS, ".png", ".jpg", ".jpeg", ".exr", ".avif", ".m4a", ".mp3", ".wav")
ALIGNMENT = 64


def check_usdz(path: Path) -> list[Finding]:
    """Check the archive: the first file is a layer, all are uncompressed, unencrypted, aligned and of allowed types."""
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
            # Packages are uncompressed: what would decompress to more than the file is not decompressed.
            plain = sum(member.file_size for member in members) <= path.stat().st_size
            broken = archive.testzip() if plain else None
    except (zipfile.BadZipFile, OSError, NotImplementedError, ValueError, zlib.error) as error:
        return [Finding("error", "UNREADABLE", f"not a readable archive ({error})", path.name)]
    findings = []

    def note(name: str, message: str) -> None:
        findings.append(Finding("error", "PACKAGE", message, f"{path.name}[{name}]"))

    if broken is not None:
        note(broken, "is damaged")
    if not members or PurePosixPath(members[0].filename).suffix.lower() not in LAYERS:
        note(members[0].filename if members else "", "the first file is not a layer")
    with path.open("rb") as stream:
        for member in members:
            if member.compress_type != zipfile.ZIP_STORED:
                note(member.filename, "is compressed")
            if member.flag_bits & 1:
                note(member.filename, "is encrypted")
            place = PurePosixPath(member.filename)
            if place.is_absolute() or ".." in place.parts:
                note(member.filename, "leads out of the package")
            if PurePosixPath(member.filename).suffix.lower() not in ALLOWED:
                note(member.filename, "is of a type that packages may not hold")
            # The local header, not that in the directory, determines where the data begins.
            stream.seek(member.header_offset + 26)
            head = stream.read(4)
            if len(head) < 4:
                note(member.filename, "begins beyond the end of the file")
                continue
            name, extra = struct.unpack("<2H", head)
            start = member.header_offset + 30 + name + extra
            if start % ALIGNMENT:
                note(member.filename, f"begins at byte {start}, not a multiple of {ALIGNMENT}")
    return findings
