"""Small collections: a drawn figure in several colours and sizes, converted by rules and without networks."""

from __future__ import annotations

import csv
import hashlib
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from fig2mesh.batch.collections.rows import Row
from fig2mesh.batch.ledger import WORK
from fig2mesh.batch.row_files import Roots
from fig2mesh.batch.task import Batch, RowTask
from fig2mesh.batch.tasks import make_task
from tests.drawn import write_figure

QUICK = {"quality": "draft", "parts": "outline", "textures": "none", "mesher": "isosurface", "triangles": 800}
"""Options of rows where the conversion is not the point: about a second a figure, no network."""


def write_pictures(folder: Path, count: int = 3) -> list[dict[str, Any]]:
    """Pictures with joints in `folder`, all different; rows that convert them, each at its own place."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = []
    for number in range(count):
        files = write_figure(folder, 1, f"person{number}")
        pixels = np.array(Image.open(files.image))
        pixels[..., number % 3] //= 1 + number
        Image.fromarray(pixels).save(files.image)
        rows.append(
            {"figure": files.image.name, "keypoints": files.keypoints.name, "lon": 8.5 + number / 100, "lat": 47.4}
        )
    return rows


def write_csv(path: Path, rows: Iterable[Mapping[str, Any]]) -> Path:
    """A table of the rows; columns in the order in which they first appear."""
    rows = list(rows)
    with path.open("w", encoding="utf-8", newline="") as stream:
        table = csv.DictWriter(stream, list(dict.fromkeys(column for row in rows for column in row)))
        table.writeheader()
        table.writerows(rows)
    return path


def batch_of(folder: Path, out: Path, **changes: Any) -> Batch:
    """A batch over the files in `folder`."""
    return Batch(Roots(folder, folder.resolve()), out, **changes)


def task_of(values: Mapping[str, Any], name: str = "person", number: int = 1) -> RowTask:
    """A row with a name."""
    return make_task(Row(number, f"line {number + 1}", values), name, name, {})


def tree(folder: Path) -> dict[str, str]:
    """Every visible file in a folder, with its digest; of the manifest everything except the seconds."""
    found = {}
    for path in sorted(folder.rglob("*")):
        inner = path.relative_to(folder)
        if path.is_file() and inner.parts[0] != WORK:
            found[inner.as_posix()] = hashlib.sha256(path.read_bytes()).hexdigest()
    found["manifest.jsonl"] = json.dumps([{**row, "seconds": 0} for row in manifest(folder)])
    return found


def manifest(folder: Path) -> list[dict[str, Any]]:
    """The rows of a manifest."""
    return [json.loads(line) for line in (folder / "manifest.jsonl").read_text(encoding="utf-8").splitlines()]


def events(text: str) -> list[dict[str, Any]]:
    """The events of `--progress json`."""
    return [json.loads(line) for line in text.splitlines()]
