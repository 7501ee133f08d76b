"""The clients of the browser: which outputs each opens, and what they make of them."""

from __future__ import annotations

import base64
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from tests.browser import pixels
from tests.clients.measure import (
    SIZE,
    Record,
    box_of,
    camera_of,
    colours_off,
    errors_of,
    matched,
    matrix_of,
    overlap_of,
    shown,
    transform_of,
    view_of,
)
from tests.clients.outputs import COLLECTION, OUTPUTS, PLACE, Made
from tests.pages import CESIUM_OLD, acted, version

TEXELS = 50_000_000
"""Read back from canvases, at which the page gives up: some clients read a property texture anew for each vertex."""

GLTF = ("glb", "gltf", "glb cesiumjs", "glb blender")
TILES = ("tiles", "tiles 1.0", "tiles cesiumjs", "tiles lods", "six", "six 1.0")
CESIUM_TWO_YEARS_AGO = ("glb", "glb cesiumjs", "tiles", "tiles 1.0", "tiles lods", "six", "czml")
KINDS = {"obj": "obj", "ply": "ply", "usda": "usd", "usdc": "usd", "usdz": "usd", "czml": "czml", "geojson": "geojson"}


@dataclass(frozen=True)
class Client:
    """A client of the browser.

    module : of tests/clients/pages
    package : whose version the table gives
    outputs : what it is tried with
    options : for its module
    globe : whether it places models on the earth itself
    """

    name: str
    module: str
    package: str
    outputs: tuple[str, ...]
    options: dict[str, Any] = field(default_factory=dict)
    globe: bool = False


CLIENTS = (
    Client("three.js", "three", "three", (*GLTF, "obj", "ply", "usda", "usdc", "usdz")),
    Client("3d-tiles-renderer", "tiles_renderer", "3d-tiles-renderer", TILES),
    Client("Babylon.js, right-handed", "babylon", "babylonjs", GLTF, {"rightHanded": True}),
    Client("Babylon.js, left-handed", "babylon", "babylonjs", ("glb",)),
    Client("CesiumJS", "cesium", "cesium", (*GLTF, *TILES, "czml", "geojson"), {"folder": "cesium"}, True),
    Client("CesiumJS", "cesium", CESIUM_OLD, CESIUM_TWO_YEARS_AGO, {"folder": "cesium_old"}, True),
    Client("model-viewer", "model_viewer", "@google/model-viewer", GLTF),
    Client("deck.gl", "deck", "deck.gl", (*GLTF, *TILES), globe=True),
    Client("iTowns", "itowns", "itowns", TILES),
)


def kind_of(key: str) -> str:
    """How a page opens an output."""
    return KINDS.get(key, "gltf" if key.startswith(("glb", "gltf")) else "tiles")


@dataclass(frozen=True)
class _View:
    """A picture that was asked for: of which output, from where, and where the figures belong that it should show."""

    camera: dict[str, Any]
    asked: dict[str, np.ndarray]


def _views(client: Client, key: str, made: Made) -> list[_View]:
    low, high = made.vertices.min(axis=0), made.vertices.max(axis=0)
    frame = "earth" if client.globe else OUTPUTS[key].frame
    if not key.startswith("six"):
        matrix = matrix_of(frame, PLACE)
        return [_View(_with_bearing(camera_of(matrix, low, high), PLACE.heading_deg), {"farmer": matrix})]
    views = []
    places = {name: matrix_of("earth", each) for name, each in COLLECTION.items()}
    near = {name: places[name] for name in ("south", "east", "north", "west")}
    group = camera_of(places["south"], low, high, 40.0)
    views.append(_View(_with_bearing(group, COLLECTION["south"].heading_deg), near))
    for name in ("patagonia", "antimeridian"):
        camera = camera_of(places[name], low, high)
        views.append(_View(_with_bearing(camera, COLLECTION[name].heading_deg), {name: places[name]}))
    return views


def _with_bearing(camera: dict[str, Any], heading_deg: float) -> dict[str, Any]:
    return camera | {"bearing_deg": (heading_deg + 180.0) % 360.0}


def measure(
    made: Made, cesium: Path, modules: tuple[str, ...] = (), outputs: tuple[str, ...] = ()
) -> tuple[list[Record], dict[str, bytes]]:
    """Records and pictures, by client and output: of all, or of the named modules and outputs."""
    place = {"lon_deg": PLACE.lon_deg, "lat_deg": PLACE.lat_deg, "height_m": PLACE.height_m}
    place["bearing_deg"] = PLACE.heading_deg
    actions: list[dict[str, Any]] = []
    plan: list[tuple[Client, str | None, _View | None]] = []
    for client in CLIENTS:
        if modules and client.module not in modules:
            continue
        actions.append(_call("start", {"client": client.module, "options": client.options}))
        plan.append((client, None, None))
        for key in outputs or client.outputs:
            job = {"kind": kind_of(key), "url": f"/files/{OUTPUTS[key].path}", "place": place, "texels": TEXELS}
            actions.append(_call("open", job))
            plan.append((client, key, None))
            for view in _views(client, key, made):
                actions += [_call("look", view.camera), {"screenshot": True}]
                plan += [(client, key, view), (client, key, view)]
    done = acted(made.folder, cesium, actions, SIZE)
    if len(done["results"]) != len(actions):
        raise RuntimeError(f"messages of the page: {done['messages'][-5:]}")
    elsewhere = [each for each in done["requests"] if not each.startswith(done["address"])]
    if elsewhere:
        raise RuntimeError(f"clients request {elsewhere[:5]}")
    answers = iter(zip(plan, done["results"], strict=True))
    records, pictures = [], {}
    for (client, key, view), result in answers:
        if key is None:
            held = result["value"].get("version") or version(client.package)
            if "error" in result["value"]:
                raise RuntimeError(f"{client.name} does not start: {result['value']['error']}")
            continue
        if view is None:
            opened, record_views = result["value"], []
        else:
            _, shot = next(answers)
            record_views.append((view, result["value"], base64.b64decode(shot["png"])))
            pictures[f"{client.name} {held} {key} {len(record_views)}"] = record_views[-1][2]
        if len(record_views) == len(_views(client, key, made)):
            records.append(_record(client, held, key, opened, record_views, made))
    return records, pictures


def levels_selected(made: Made, cesium: Path, distances: list[float], fov_deg: float, rows: int) -> list[str]:
    """Names of the files that CesiumJS shows of the tileset of levels, for each distance of its box, metres."""
    matrix = matrix_of("earth", PLACE)
    low, high = made.vertices.min(axis=0), made.vertices.max(axis=0)
    actions = [_call("start", {"client": "cesium", "options": {"folder": "cesium"}})]
    actions.append(_call("open", {"kind": "tiles", "url": f"/files/{OUTPUTS['tiles lods'].path}"}))
    for distance in distances:
        camera = camera_of(matrix, low, high, distance + high[2])
        actions.append(_call("look", camera | {"fov_deg": fov_deg, "rows": rows}))
    looks = [each["value"] for each in acted(made.folder, cesium, actions, SIZE)["results"][2:]]
    if errors := [each["error"] for each in looks if "error" in each]:
        raise RuntimeError(errors[0])
    names = [{figure["tile"].rpartition("/")[2] for figure in each["figures"]} for each in looks]
    if any(len(each) != 1 for each in names):
        raise RuntimeError(f"CesiumJS shows several levels at once: {names}")
    return [each.pop() for each in names]


def _call(name: str, job: dict[str, Any]) -> dict[str, Any]:
    return {"evaluate": f"matrix.{name}({json.dumps(job)})"}


def _record(
    client: Client,
    held: str,
    key: str,
    opened: dict[str, Any],
    views: list[tuple[_View, dict[str, Any], bytes]],
    made: Made,
) -> Record:
    base = {"client": client.name, "version": held, "output": key}
    error = opened.get("error") or next((each["error"] for _, each, _ in views if "error" in each), None)
    if error:
        return Record(**base, result="refused", note=error[:200])
    low, high = made.vertices.min(axis=0), made.vertices.max(axis=0)
    places, bearings, heights, edges, colours, overlaps = [], [], [], [], [], []
    count = 0
    for view, found, png in views:
        seen = found["figures"]
        if key == "geojson":
            places += [float(np.linalg.norm(np.array(seen[0]["matrix"])[12:15] - view.asked["farmer"][:3, 3]))]
            count += 1
            continue
        bodies = [each for each in seen if "outline" not in (each["name"] or "")]
        # deck.gl does not give the place of a model in a layer: it is known from the picture alone.
        local = client.module == "deck" and kind_of(key) == "gltf"
        asked = {"farmer": np.eye(4)} if local else view.asked
        pairs = matched([transform_of(each, low, high) for each in bodies], asked)
        count += len(pairs)
        for name, actual in pairs.items():
            place, bearing, height = errors_of(actual, asked[name])
            places.append(place)
            bearings.append(bearing)
            heights.append(height)
        picture = pixels(base64.b64encode(png).decode())
        world = [np.c_[made.vertices, np.ones(len(made.vertices))] @ matrix.T for matrix in view.asked.values()]
        expected = np.concatenate([view_of(view.camera, points[:, :3]) for points in world])
        box = np.concatenate([expected.min(axis=0), expected.max(axis=0)])
        colours.append(colours_off(picture, 12 if len(view.asked) == 1 else 3))
        if client.module == "deck":
            continue  # seen from above
        edges.append(float(np.abs(box_of(shown(picture)) - box).max()))
        if len(view.asked) == 1:
            overlaps.append(overlap_of(picture))
    return Record(
        **base,
        place_m=max(places),
        bearing_deg=max(bearings, default=None),
        height_percent=max(heights, default=None),
        picture_px=max(edges, default=None),
        overlap=min(overlaps, default=None),
        colours=max(colours, default=None),
        seconds=opened["seconds"] + sum(each["seconds"] for _, each, _ in views),
        figures=count,
        texels=views[-1][1]["reads"]["texels"],
    )
