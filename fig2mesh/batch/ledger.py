"""What is known of each figure of a collection: a small file each, so that no crash can take more than one along.

A record appears whole or not at all and carries a digest of itself; one that is damaged counts as a figure that was
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
"""Folder, in that of the outputs, of everything that reruns go on from."""

BEGUN: Final = "begun"

DAMAGED: Final = {"status": BEGUN, "claimed": True}
"""What stands for a record that cannot be read: its folder is ours, and nothing is known of it."""


@dataclass(frozen=True)
class Ledger:
    """The records of the collection whose outputs are in `folder`."""

    folder: Path

    def path(self, name: str) -> Path:
        """Where the record of the figure in `folder/name` is."""
        return self.folder / WORK / "records" / hashlib.sha256(name.encode()).hexdigest()[:2] / f"{name}.json"

    def read(self, name: str) -> dict[str, Any] | None:
        """The record of a figure; None where there is none, `DAMAGED` where it cannot be read."""
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
        """Keep a record. Raises OSError where the disk refuses."""
        path = self.path(name)
        path.parent.mkdir(parents=True, exist_ok=True)
        write_text(path, json.dumps([record, _digest(record)], ensure_ascii=False))

    def names(self) -> set[str]:
        """Names of all figures that were ever begun here."""
        return {path.stem for path in (self.folder / WORK / "records").glob("*/*.json")}


def _digest(record: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(record, sort_keys=True).encode()).hexdigest()
