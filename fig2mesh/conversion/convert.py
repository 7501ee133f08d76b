"""The conversion of one figure: from a request to a placed model. It reads the figure's files and writes none."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from exporters.asset import Asset
from exporters.write import has_levels
from fig2mesh.asset_frame import asset_from_figure, on_drawing
from fig2mesh.conversion.asset import asset_of
from fig2mesh.conversion.keys import figure_digest
from fig2mesh.conversion.observer import Observer
from fig2mesh.conversion.place import Placed, open_map, place
from fig2mesh.conversion.plan import Plan, normals_of, plan
from fig2mesh.conversion.request import Request
from fig2mesh.conversion.runner import Inputs, Results, Runner
from fig2mesh.conversion.stores import FolderStore, NoStore, Store
from fig2mesh.errors import InputError
from fig2mesh.image_frame import image_frame
from fig2mesh.measure.lost import lost_in_model, lost_specks
from fig2mesh.parse.checks.person import check_person
from fig2mesh.parse.read import read_figure
from fig2mesh.parts.pieces import CleanFigure, clean
from fig2mesh.records import Figure
from fig2mesh.settings import Settings
from fig2mesh.skeleton import FIGURE_HEIGHT
from fig2mesh.stages.lift import lift
from fig2mesh.stages.model import model
from fig2mesh.stages.simplify import simplify
from fig2mesh.stages.solid import solid
from fig2mesh.stages.table import STAGES

if TYPE_CHECKING:
    from georef.mapsheet import MapSheet

log = logging.getLogger("fig2mesh")

REQUEST = "request"
"""Name of the file, beside those of the stages, that holds the figure's digest and the settings."""


@dataclass(frozen=True)
class FigureRun:
    """Results of the stages for one figure.

    figure : without specks, cropped to its silhouette
    pieces : number of connected pieces of the drawing; specks : number of those that were too small to model
    """

    figure: Figure
    pieces: int
    specks: int
    results: Results


@dataclass(frozen=True)
class Conversion:
    """A model, with the request, settings and stage results that it was made from.

    lost : doubts about parts of the drawing that it does not have; they are among those of its figure
    """

    request: Request
    settings: Settings
    run: FigureRun
    placed: Placed
    asset: Asset
    lost: tuple[str, ...] = ()

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes for the user about the model, one line each."""
        notes = list(self.lost)
        if self.run.specks:
            notes.append(f"{self.run.specks} specks of the silhouette are too small to model and were left out")
        found = self.run.results[solid].how
        if found.components != self.run.pieces:
            note = f"; {found.note}" if found.note else ""
            notes.append(f"{found.components} solids for {self.run.pieces} drawn pieces{note}")
        return tuple(notes)

    @property
    def plan(self) -> Plan:
        """The stages and effects that the request needed, with reasons."""
        return plan(self.settings, self.request.targets)

    def _repr_png_(self) -> bytes:
        """PNG of the drawing and of the model from the front, the side and behind, for notebooks."""
        from PIL import Image

        from fig2mesh.mesh.preview import views_sheet

        figure = self.run.figure
        sheet = views_sheet(self.asset.mesh, figure.rgba, mask=figure.mask, yaws=(0, 90, 180), height=360)
        stream = BytesIO()
        Image.fromarray(sheet).save(stream, "PNG")
        return stream.getvalue()


def run_stages(
    figure: Figure,
    settings: Settings,
    goals: Sequence[Callable[..., object]],
    *,
    height_m: float = FIGURE_HEIGHT,
    store: Store | None = None,
    observer: Observer | None = None,
) -> FigureRun:
    """Run the stage functions `goals`, and the stages that they need.

    figure : as it was read; height_m : of the model, metres
    """
    runner = Runner(settings, store=store or NoStore(), observer=observer or Observer())
    return _run(runner, clean(figure, settings.voxel, settings.picture_px), goals, height_m)


def _run(runner: Runner, cleaned: CleanFigure, goals: Sequence[Callable[..., object]], height_m: float) -> FigureRun:
    results = runner.run(goals, Inputs(cleaned.figure, cleaned.pieces, height_m))
    return FigureRun(*cleaned, results)


def convert(
    request: Request,
    figure: Figure | None = None,
    *,
    sheet: MapSheet | None = None,
    store: Store | None = None,
    observer: Observer | None = None,
) -> Conversion:
    """Make the model that a request asks for.

    Parameters
    ----------
    figure : the figure, if the files of the request have been read already; default: they are read
    sheet : the map of the request, if it has been opened already; default: it is opened
    store : where results of stages are looked up and kept; default: the folder of `request.save_stages`
    observer : notified of each stage

    Raises
    ------
    FigureError, InputError : a file or a value cannot be used, or hardly a person is found; see
        `fig2mesh.parse.read.read_figure` and `fig2mesh.conversion.place.open_map`
    """
    observer = observer or Observer()
    check_stages(request)
    start = time.perf_counter()
    sheet = sheet or open_map(request)
    placing_s = time.perf_counter() - start
    drawn = figure or read_figure(**request.reading(), name=request.title, force=request.force)
    check_person(request.figure, drawn.score, request.force)
    settings = settings_of(request)
    if store is None and request.save_stages is not None:
        store = folder_store(request.save_stages, drawn, settings, request.resume_from)
    cleaned = clean(drawn, settings.voxel, settings.picture_px)
    lost = lost_specks(drawn, cleaned.figure) if cleaned.specks else ()
    del drawn, figure  # four bytes per pixel of what may be a whole sheet
    start = time.perf_counter()
    placed = place(request, sheet, cleaned.figure, request.figure)
    if request.has_place:
        why = "at --map" if request.map is not None else "at --lonlat"
        observer.note("place", why, placing_s + time.perf_counter() - start)
    runner = Runner(settings, store=store or NoStore(), observer=observer)
    run = _run(runner, cleaned, (lift, solid, simplify, model), placed.height_m)
    lost = (*lost, *_lost(run, placed))
    run = replace(run, figure=replace(run.figure, doubts=(*run.figure.doubts, *lost)))
    asset = asset_of(request, run.figure, run.results[model], settings, placed)
    return Conversion(request, settings, run, placed, asset, lost)


def _lost(run: FigureRun, placed: Placed) -> tuple[str, ...]:
    """Doubts about parts of the drawing that the model has not."""
    mesh = run.results[model][0]
    transform = asset_from_figure(run.results[lift], run.results[simplify][0].vertices, placed.height_m)
    pixel, origin_px = on_drawing(image_frame(run.figure), transform)
    return lost_in_model(mesh, run.figure, metres_per_pixel=pixel, origin_px=origin_px)


def settings_of(request: Request) -> Settings:
    """Settings of a request, adapted to its outputs; where it names none, to whatever any output may need."""
    lods = request.lods
    one_level = bool(request.outputs) and not any(map(has_levels, request.outputs))
    if lods > 1 and one_level and request.resume_from is None:
        log.info("--lods %d: only 3D Tiles and USD have levels of detail; making one", lods)
        lods = 1
    settings = replace(request.settings(), lods=lods)
    return replace(settings, normals=not request.outputs or normals_of(settings, request.outputs).runs)


def check_stages(request: Request) -> None:
    """Reject --resume-from with an unknown stage or without --save-stages."""
    names = [stage.name for stage in STAGES]
    if request.resume_from is not None and request.resume_from not in names:
        raise InputError("--resume-from", f"unknown stage {request.resume_from!r}", f"choose from {', '.join(names)}")
    if request.resume_from is not None and request.save_stages is None:
        raise InputError("--resume-from", "requires --save-stages", "add --save-stages DIR")


def folder_store(folder: Path, figure: Figure, settings: Settings, resume_from: str | None) -> FolderStore:
    """The store of --save-stages: emptied, or, to resume, checked to be of this figure and these settings.

    figure : as it was read; resume_from : name of the first stage to run again
    """
    requested = {"figure": figure_digest(figure), **asdict(settings)}
    if resume_from is None:
        for path in folder.glob("*.npz"):
            if path.stem in (REQUEST, *(stage.name for stage in STAGES)):
                path.unlink()
        store = FolderStore(folder)
        store.write_file(REQUEST, requested)
        return store
    first = next(number for number, stage in enumerate(STAGES) if stage.name == resume_from)
    before = FolderStore(folder).read_file(REQUEST, dict[str, Any])
    unless = STAGES[first].unless
    if STAGES[first].left_out(settings) is not None and unless is not None:
        option = f"--{unless.setting} {unless.value}"
        raise InputError("--resume-from", f"{resume_from} is not run with {option}", "choose another stage")
    if before.get("figure") != requested["figure"]:
        raise InputError(
            "--resume-from", "the stages were made from another figure", "give that figure, or leave out --resume-from"
        )
    for stage in STAGES[:first]:
        for name in stage.reads:
            if before.get(name) != requested[name]:
                found = f"the stages were made with {name} {before.get(name)}, not {requested[name]}"
                raise InputError("--resume-from", found, f"start at {stage.name} or earlier")
    return FolderStore(folder, frozenset(stage.name for stage in STAGES[:first]))
