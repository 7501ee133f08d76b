"""Every reader of files from elsewhere: seeds, how it is called, and what it may cost.

A further reader is one more entry of `READERS`: a function that makes intact inputs and one that reads the main file.
Its result is discarded; the function itself asserts that a returned record is valid.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from georef.errors import InputError
from tests.fuzz import collections, seeds
from tests.fuzz.seeds import Input


@dataclass(frozen=True)
class Reader:
    """A reader to be fed with damaged files.

    seeds : makes the intact inputs that damage starts from; the reader has to accept each
    read : reads the main file of an input; may raise InputError and nothing else
    weight : its share of the inputs; what is quick gets more of them
    memory_mb : what reading a small file may add to the address space of a process that has read intact ones
    """

    seeds: Callable[[], Iterator[Input]]
    read: Callable[[Path], object]
    weight: float = 1.0
    memory_mb: int = 1024


def read_joints(path: Path) -> None:
    from fig2mesh.parse.keypoints import read_keypoints

    joints = read_keypoints(path, "figure.png")
    assert np.isfinite(joints.points_px).all()
    assert joints.size is None or min(joints.size) > 0


def read_picture(path: Path) -> None:
    from fig2mesh.parse.picture import read_labels, read_mask, read_view

    view = read_view(path, None)
    assert view.rgba.ndim == 3
    if view.rgba.size > 4e6:
        return  # each further reading would take its seconds, and all of them be called a hang
    with suppress(InputError):
        read_mask(path, view)
    with suppress(InputError):
        read_labels(path, view)
    with suppress(InputError):
        read_view(path, (1, 1, 5, 4))


def read_scan(path: Path) -> None:
    from fig2mesh.parse.window import is_large, read_window, size_of

    is_large(path)
    with suppress(InputError):
        size_of(path)
    pixels, size = read_window(path, (2, 3, 11, 9))
    assert pixels.shape == (6, 9, 4)
    assert min(size) > 8


def read_map(path: Path) -> None:
    from georef.mapsheet import read_sheet

    sheet = read_sheet(path)
    place = sheet.place(20.0, 15.0)
    assert np.isfinite([place.lon_deg, place.lat_deg, place.up_bearing_deg, place.up_m, place.across_m]).all()


def read_heights(path: Path) -> None:
    from georef.heights import ellipsoidal_height

    assert np.isfinite(ellipsoidal_height(8.1, 46.9, 400.0, path))


def look(path: Path) -> None:
    from exporters.inspect import inspect

    inspect(path)


def check(path: Path) -> None:
    from exporters.validate import validate

    for finding in validate(path, external=False):
        assert_one_line(str(finding))


def look_and_check(path: Path) -> None:
    check(path)
    look(path)


def read_tiles(path: Path) -> None:
    from exporters.figure_reader import read_figures

    check(path)
    with suppress(InputError):
        look(path)
    with suppress(InputError):
        list(read_figures(path))


def read_glb(path: Path) -> None:
    from exporters.figure_reader import read_figure

    check(path)
    with suppress(InputError):
        look(path)
    read_figure(path)


def read_batched(path: Path) -> None:
    """A batched 3D model is content of a tileset around it."""
    tileset = path.with_name("around.json")
    if not tileset.is_file():
        volume = {"region": [-3.0, -1.5, 3.0, 1.5, -1e4, 1e4]}
        root = {"boundingVolume": volume, "geometricError": 0, "refine": "ADD", "content": {"uri": path.name}}
        import json

        tileset.write_text(json.dumps({"asset": {"version": "1.0"}, "geometricError": 1, "root": root}))
    check(tileset)


def read_drawn_model(path: Path) -> None:
    from fig2mesh.render.model import read_model

    mesh = read_model(path)
    assert np.isfinite(mesh.vertices).all()


def read_stage(path: Path) -> None:
    from fig2mesh.conversion.record_file import read_record
    from fig2mesh.stages.table import STAGES

    beside = path.with_name("stage")
    stage = beside.read_bytes().decode("ascii", "ignore") if beside.is_file() else "lift"
    stage = stage if stage.isalpha() and len(stage) < 40 else "lift"
    shutil.copyfile(path, path.with_name(f"{stage}.npz"))
    kinds = {each.name: each.makes for each in STAGES} | {"request": dict[str, Any]}
    read_record(path.with_name(f"{stage}.npz"), stage, kinds.get(stage, kinds["lift"]))


def read_weights(path: Path) -> None:
    import torch

    from fig2mesh.nets.weights import WeightsFile

    def make(shape: dict[str, int]) -> torch.nn.Linear:
        return torch.nn.Linear(shape["inputs"] % 1000, shape["outputs"] % 1000)

    WeightsFile("linear", "linear network", make, lambda shape: shape, lambda shape: "linear").read(path)


def read_for_globe(path: Path) -> None:
    from fig2mesh.globe.assets import find_assets
    from fig2mesh.globe.page import globe_page, page_files

    found = find_assets((path,))
    globe_page(found)
    for address in page_files(found):
        assert ".." not in address.split("/")


def globe_inputs() -> Iterator[Input]:
    yield from seeds.glbs()
    yield from seeds.tilesets()
    yield from seeds.entities()


READERS: dict[str, Reader] = {
    "joints": Reader(seeds.joints, read_joints, 6),
    "picture": Reader(seeds.pictures, read_picture, 2, 2560),
    "window": Reader(seeds.scans, read_scan, 3, 2048),
    "world-file": Reader(seeds.world_files, read_map, 0.3),
    "points": Reader(seeds.points_files, read_map, 2),
    "annotation": Reader(seeds.annotations, read_map, 2),
    "geotiff": Reader(seeds.geotiffs, read_map, 3),
    "heights": Reader(seeds.height_grids, read_heights, 5),
    "glb": Reader(seeds.glbs, read_glb, 2),
    "gltf": Reader(seeds.gltfs, look_and_check, 0.5),
    "b3dm": Reader(seeds.b3dms, read_batched, 1.5),
    "tileset": Reader(seeds.tilesets, read_tiles, 0.5),
    "entities": Reader(seeds.entities, look_and_check, 3),
    "usd": Reader(seeds.stages, look_and_check, 0.1),
    "triangles": Reader(seeds.triangle_files, look_and_check, 1),
    "model": Reader(seeds.models, read_drawn_model, 1),
    "stage": Reader(seeds.stage_files, read_stage, 3),
    "weights": Reader(seeds.weights, read_weights, 3),
    "globe": Reader(globe_inputs, read_for_globe, 2),
    "collection": Reader(collections.collections, collections.read_collection, 4),
    "record": Reader(collections.records, collections.read_record, 1),
}


def assert_one_line(text: str) -> None:
    """Messages for people are one line of printable characters, of reasonable length."""
    assert text.isprintable(), f"not one printable line: {text[:200]!r}"
    assert len(text) < 2500, f"a line of {len(text)} characters: {text[:200]!r}"
