"""`fig2mesh render`: read a drawing or a model, make the pictures, write them. All side effects are here."""

from __future__ import annotations

import json
import logging
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from PIL import ImageColor

from exporters.asset import without_outline
from fig2mesh.conversion.convert import run_stages
from fig2mesh.conversion.text_file import check_text, write_text
from fig2mesh.errors import FigureError, InputError
from fig2mesh.image_frame import image_frame
from fig2mesh.parse.read import read_figure
from fig2mesh.parts.smooth_union import smooth_union
from fig2mesh.records import ByteArray, Figure
from fig2mesh.render.counts import Counts
from fig2mesh.render.effects import Effect, check_effects, parse_effects
from fig2mesh.render.images_out import KINDS, check_pictures, kind_of, write_pictures
from fig2mesh.render.model import SUFFIXES, read_model
from fig2mesh.render.needs import needs
from fig2mesh.render.picture import PictureRequest, render, view_of
from fig2mesh.render.request import RenderRequest
from fig2mesh.render.scene import FieldScene, MeshScene, Scene
from fig2mesh.render.sun import Sun, parse_time, sun_at, towards_sun
from fig2mesh.settings import Settings
from fig2mesh.stages.body import body
from fig2mesh.stages.parts import parts
from fig2mesh.stages.textures import textures
from fig2mesh.terminal import print_outputs, progress
from georef.bearing import parse_facing
from georef.placement import check_lonlat

log = logging.getLogger("fig2mesh")

FRAMES, FPS = 36, 12.5
"""A turn in three seconds; GIF can represent 8 hundredths of a second per frame exactly."""

MAX_RAYS = 1 << 26
"""Rays of one picture: 8192 x 8192 pixels with one ray each need 2 GB."""

Colour = tuple[int, int, int]

MIN_LINE_PX = 0.5
"""Least width of an outline as wide as the drawn line, pixels."""


@dataclass
class _Total:
    """Number of pictures made so far, and the counts of their work."""

    counts: Counts = field(default_factory=Counts)
    pictures: int = 0


def run(request: RenderRequest, quiet: bool = False) -> None:
    """Run `fig2mesh render`; quiet : without progress."""
    # Whatever can be rejected is rejected before the work begins.
    wanted = parse_effects(request.effects)
    fields = request.figure.suffix.lower() not in SUFFIXES
    check_effects(request.mode, wanted, fields=fields)
    drawing = (request.mask, request.keypoints, request.part_labels, request.bbox, request.textures)
    if not fields and drawing != (None,) * 5:
        raise InputError(
            request.figure, "a finished model cannot be combined with --mask, --keypoints …", "leave them out"
        )
    sun = _sun(wanted, request.lonlat, request.time)
    moving = KINDS[kind_of(request.output)].moving
    count, rate = _timing(moving, request.frames, request.fps, request.seconds, request.output)
    first = _picture_request(request, wanted, sun)
    check_pictures(request.output, request.overwrite, request.size, first.background is None)
    if request.report is not None:
        check_text(request.report, request.overwrite)
    if sun is not None and not sun.up:
        log.info("the sun is %.1f° below the horizon: only the sky gives light", -sun.elevation_deg)

    start = time.perf_counter()
    scene: Scene
    if fields:
        scene = field_scene(read_figure(**request.reading()), request.settings(), first)
    else:
        scene = _mesh_scene(request.figure, first)
    first = _with_drawn_line(first, scene, request.outline_width)
    ready = time.perf_counter()
    total = _Total()
    with progress(quiet or count == 1) as advance:
        pictures = _turntable(scene, first, count, total, advance)
        written = write_pictures(request.output, pictures, rate, request.overwrite)
    done = time.perf_counter()
    if request.report is not None:
        facts = _facts(request, first, scene, total, sun)
        facts["seconds"] = {"scene": round(ready - start, 3), "pictures": round(done - ready, 3)}
        facts["files"] = [path.name for path in written]
        write_text(request.report, json.dumps(facts, indent=2, allow_nan=False) + "\n")
    print_outputs(request.output)


def _picture_request(request: RenderRequest, wanted: frozenset[Effect], sun: Sun | None) -> PictureRequest:
    """Request of the first picture; the others differ in yaw."""
    bearing = parse_facing(request.facing)
    paper = _background(request.background, KINDS[kind_of(request.output)].transparent)
    samples = request.samples or (1 if request.mode in ("depth", "parts") else 2)
    if request.size[0] * request.size[1] * samples**2 > MAX_RAYS:
        found = f"{request.size[0]} {request.size[1]} with --samples {samples} is too large"
        raise InputError("--size", found, "reduce either")
    return PictureRequest(
        request.mode,
        wanted,
        request.size,
        request.yaw,
        request.pitch,
        samples,
        paper,
        request.ground,
        towards_sun(sun, bearing) if sun is not None and sun.up else None,
        outline_colour=_colour("--outline-colour", request.outline_colour),
    )


def _with_drawn_line(request: PictureRequest, scene: Scene, width_px: float | None) -> PictureRequest:
    """Request whose outlines have the given width, or else the drawn line's at the scale of the picture, if known."""
    if width_px is None and scene.line_width > 0:
        width_px = max(scene.line_width / view_of(scene, request).camera.pixel, MIN_LINE_PX)
    return request if width_px is None else replace(request, outline_px=width_px)


def _turntable(
    scene: Scene, request: PictureRequest, count: int, total: _Total, advance: Callable[[str], object]
) -> Iterator[ByteArray]:
    """Yield `count` pictures of a full turn, beginning with the requested one; advance : called before each."""
    for index in range(count):
        advance(f"picture {index + 1} of {count}")
        picture = render(scene, replace(request, yaw_deg=request.yaw_deg + 360.0 * index / count))
        total.counts += picture.counts
        total.pictures += 1
        log.debug("picture %d of %d", index + 1, count)
        yield picture.rgba


def field_scene(figure: Figure, settings: Settings, request: PictureRequest) -> FieldScene:
    """Scene of the part fields of a figure and, if the request shows them, its colours."""
    goals = (body, parts, textures) if needs(request.mode, request.effects).textures else (body, parts)
    done = run_stages(figure, settings, goals)
    fields, sources = done.results[body], done.results[textures] if textures in goals else None
    if "smooth-union" in request.effects:
        fields = smooth_union(fields, done.results[parts].canvas)
    return FieldScene(fields, sources, image_frame(done.figure))


def _mesh_scene(path: Path, request: PictureRequest) -> MeshScene:
    if not path.is_file():
        raise FigureError(path, "no such file", "check the path of the model")
    mesh = read_model(path)
    if not len(mesh.faces):
        raise FigureError(path, "has no triangles", "give another model")
    if request.mode == "textured" and mesh.texture is None and mesh.colors is None:
        raise FigureError(path, "has no colours", "use --mode clay")
    if request.mode == "parts" and mesh.parts is None:
        raise FigureError(path, "has no part labels", "use a GLB made with --evidence parts")
    return MeshScene(mesh if request.mode == "textured" else without_outline(mesh))


def _sun(effects: frozenset[Effect], lonlat: tuple[float, float] | None, text: str | None) -> Sun | None:
    if "sun" not in effects:
        for name, value in (("--lonlat", lonlat), ("--time", text)):
            if value is not None:
                raise InputError(name, "requires --effects sun", "add --effects sun, or leave it out")
        return None
    if lonlat is None:
        raise InputError("--effects", "sun requires --lonlat", "add --lonlat LON LAT")
    if text is None:
        raise InputError("--effects", "sun requires --time", "add --time, such as --time 2026-06-21T14:00+02:00")
    check_lonlat(*lonlat)
    return sun_at(*lonlat, parse_time(text))


def _timing(
    moving: bool, frames: int | None, fps: float | None, seconds: float | None, output: str
) -> tuple[int, float]:
    """Number of pictures, and their rate per second; any two of the three options determine the third."""
    if not moving:
        if (frames or 1) != 1 or fps is not None or seconds is not None:
            found = "a .png cannot be combined with --frames, --fps or --seconds"
            raise InputError(output, found, "use .webp, .gif, .mp4 or a folder")
        return 1, FPS
    if frames is not None and fps is not None and seconds is not None:
        raise InputError("--seconds", "cannot be combined with both --frames and --fps", "give two of the three")
    if seconds is not None:
        count = frames or max(1, round(seconds * (fps or FPS)))
        rate = count / seconds
    else:
        count, rate = frames or FRAMES, fps or FPS
    if count > 10_000 or not 0.01 <= rate <= 100:
        raise InputError(
            "--seconds", f"{count} pictures at {rate:g} per second", "give at most 10000, at 0.01 to 100 per second"
        )
    return count, rate


def _background(text: str | None, transparent: bool) -> Colour | None:
    if text is None:
        return None if transparent else (255, 255, 255)
    return None if text.strip().lower() == "transparent" else _colour("--background", text)


def _colour(option: str, text: str) -> Colour:
    try:
        red, green, blue = ImageColor.getrgb(text)[:3]
    except ValueError:
        raise InputError(option, f"{text!r} is not a colour", "give a name such as ivory, or #rrggbb") from None
    return red, green, blue


def _facts(
    options: RenderRequest, request: PictureRequest, scene: Scene, total: _Total, sun: Sun | None
) -> dict[str, Any]:
    view = view_of(scene, request)
    return {
        "input": options.figure.name,
        "output": Path(options.output).name,
        "surface": "fields" if isinstance(scene, FieldScene) else "mesh",
        "mode": request.mode,
        "effects": sorted(request.effects),
        "size": list(request.size),
        "samples": request.samples,
        "pictures": total.pictures,
        "height_shown": view.camera.height * scene.unit,
        "depth": {"white_at": view.near * scene.unit, "black_at": view.far * scene.unit},
        "needs": asdict(needs(request.mode, request.effects, fields=isinstance(scene, FieldScene))),
        "counts": asdict(total.counts),
        "sun": None if sun is None else {"azimuth_deg": sun.azimuth_deg, "elevation_deg": sun.elevation_deg},
    }
