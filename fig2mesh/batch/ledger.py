"""Records of the figures of a collection: a small file each, so that a crash can damage at most one.

A record is written whole or not at all and contains a digest of itself. A damaged record counts as a figure that was
begun, whose outputs are made again.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from exporters.atomic_file import write_text
from georef.untrusted.damage import DamagedFile
from georef.untrusted.json_file import parse_json

WORK: Final = ".fig2mesh"
"""Folder, in the output folder, of everything that reruns resume from."""

BEGUN: Final = "begun"

DAMAGED: Final = {"status": BEGUN, "claimed": True}
"""Substitute for a record that cannot be read: its folder belongs to the batch, and nothing else is known."""


@dataclass(frozen=True)
class Ledger:
    """Records of the collection whose outputs are in `folder`."""

    folder: Path

    def path(self, name: str) -> Path:
        """Path of the record of the figure in `folder/name`."""
        return self.folder / WORK / "records" / hashlib.sha256(name.encode()).hexdigest()[:2] / f"{name}.json"

    def read(self, name: str) -> dict[str, Any] | None:
        """Record of a figure; None where there is none, `DAMAGED` where it cannot be read."""
        try:
            text = self.path(name).read_text(encoding="utf-8")
        except FileNotFoundError:
            return None
        except (OSError, UnicodeDecodeError):
            return dict(DAMAGED)
        try:
            document = parse_json(text)
        except DamagedFile:
            return dict(DAMAGED)
        if not isinstance(document, list) or len(document) != 2:
            return dict(DAMAGED)
        record, digest = document
        return record if isinstance(record, dict) and _digest(record) == digest else dict(DAMAGED)

    def write(self, name: str, record: dict[str, Any]) -> None:
        """Write a record. Raises OSError if that fails."""
        path = self.path(name)
        path.parent.mkdir(parents=True, exist_ok=True)
        write_text(path, json.dumps([record, _digest(record)], ensure_ascii=False))

    def names(self) -> set[str]:
        """Names of all figures that were ever begun here."""
        return {path.stem for path in (self.folder / WORK / "records").glob("*/*.json")}


def _digest(record: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(record, sort_keys=True).encode()).hexdigest()
