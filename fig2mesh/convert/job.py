"""The main job: read, run the pipeline, write. All side effects of the command line are here."""

from __future__ import annotations

import json
import logging
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from exporters import atomic_file
from exporters.profiles import Profile, profile_named
from exporters.write import check_outputs, has_levels, in_order, is_tileset, needs_place, write
from fig2mesh.convert.asset import SETTING_OPTIONS, asset_of, settings_of, torch_device
from fig2mesh.convert.place import Placed, PlaceRequest, clamp_note, open_map, place
from fig2mesh.convert.plan import COLOURING, Plan, plan
from fig2mesh.convert.report import Timing, make_report
from fig2mesh.counters import counting
from fig2mesh.errors import InputError, OutputError
from fig2mesh.parse.read import read_figure
from fig2mesh.records import Figure
from fig2mesh.settings import FIRST_USE, STAGES, Settings

if TYPE_CHECKING:
    from fig2mesh.convert.pipeline import Step

log = logging.getLogger("fig2mesh")

REQUEST = "request"
"""Name of the stage file that says what the others were made for."""


def run(
    *,
    figure: Path,
    outputs: tuple[str, ...],
    profile: str | None,
    mask: Path | None,
    keypoints: Path | None,
    part_labels: Path | None,
    bbox: tuple[int, int, int, int] | None,
    quality: Any,
    triangles: int | None,
    texture_size: int | None,
    lods: int,
    visible_from: float,
    tiles_version: Any,
    parts: str,
    textures: str | None,
    contours: str,
    effects: tuple[str, ...],
    mesher: str,
    closing: str,
    device: str,
    seed: int,
    name: str | None,
    credit: str,
    evidence: bool,
    save_stages: Path | None,
    resume_from: str | None,
    report: Path | None,
    overwrite: bool,
    quiet: bool,
    verbose: int,
    **where: Any,
) -> None:
    """What `fig2mesh FIGURE …` does; the parameters are the options of the command line.

    where : the fields of `PlaceRequest`
    """
    configure_logging(quiet, verbose)
    start = time.perf_counter()
    request = PlaceRequest(**where)
    sheet = open_map(request)
    placing_s = time.perf_counter() - start
    targets = outputs or (figure.stem + ".glb",)
    # Everything that can be refused is refused before the work begins.
    if resume_from is not None and resume_from not in STAGES:
        raise InputError("--resume-from", f"{resume_from} is no stage", f"choose from {', '.join(STAGES)}")
    if resume_from is not None and save_stages is None:
        raise InputError("--resume-from", "no folder of stages", "pass --save-stages DIR as well")
    client = profile_named(profile)
    client.check_tools()
    _check_targets(targets, name or figure.stem, lods, request.somewhere, overwrite, tiles_version, client)
    if not 0 < visible_from < 1e9:
        raise InputError("--visible-from", f"{visible_from:g} m", "give a distance in metres")
    if report is not None:
        check_text(report, overwrite)
    drawn = read_figure(figure, mask=mask, keypoints=keypoints, part_labels=part_labels, bbox=bbox, name=name)
    if lods > 1 and resume_from is None and not any(has_levels(target) for target in targets):
        log.info("--lods %d: only 3D Tiles and USD have levels of detail; one is made", lods)
        lods = 1
    settings = settings_of(
        quality=quality,
        triangles=triangles,
        texture_size=texture_size,
        lods=lods,
        parts=parts,
        textures=textures,
        contours=contours,
        effects=effects,
        mesher=mesher,
        closing=closing,
        device=torch_device(device),
        seed=seed,
    )
    from fig2mesh.convert.pipeline import steps
    from fig2mesh.parts.pieces import clean

    whole = drawn
    drawn, pieces, specks = clean(drawn, settings.voxel, settings.picture_px)
    start = time.perf_counter()
    placed = place(request, sheet, drawn, figure)
    timings: list[Timing] = []
    if request.somewhere:
        placing_s += time.perf_counter() - start
        timings.append(Timing("place", placing_s, peak_mb(), "at --map" if sheet is not None else "at --lonlat"))
    tell(placed, clamp_note(request, targets))
    planned = plan(settings, targets)
    stages = None if save_stages is None else _stages(save_stages, whole, settings, planned.normals, resume_from)
    del whole  # four bytes a pixel of what may be a whole sheet
    if specks:
        log.warning("%s: %d specks of the silhouette are too small to model and were left out", figure, specks)
    results: dict[str, Any] = {"figure": drawn, "pieces": pieces}
    written: list[Path] = []
    with progress(quiet) as advance, counting() as counts:
        road = steps(settings, placed.height_m, normals=planned.normals)
        _run_steps(road, results, timings, stages, resume_from, advance, planned)
        found = results["solid"].how
        if found.components != pieces:
            log.warning("%s: %d solids for %d drawn pieces; %s", figure, found.components, pieces, found.note)
        asset = asset_of(
            drawn.name,
            results["model"],
            settings,
            placed,
            source=figure.name,
            quality=quality,
            credit=credit,
            evidence=evidence,
        )
        for target in in_order(targets):
            advance(f"write {target}")
            start = time.perf_counter()
            written += write(
                asset,
                target,
                overwrite=overwrite,
                visible_from_m=visible_from,
                tiles_version=tiles_version,
                profile=client,
            )
            timings.append(Timing(f"write {target}", time.perf_counter() - start, peak_mb(), "an output"))
    if report is not None:
        inputs = [path for path in (figure, mask, keypoints, part_labels) if path is not None]
        facts = make_report(inputs, written, asset, results, settings, placed.height_m)
        facts["map"] = placed.map
        facts["stages"] = [timing.as_dict() for timing in timings]
        facts["effects"] = [{"effect": each.name, "run": each.runs, "why": each.why} for each in planned.effects]
        facts["counters"] = counts
        write_text(report, json.dumps(facts, indent=2, allow_nan=False) + "\n")
    for target in targets:
        log.info("%s", target)


def _run_steps(
    road: Sequence[Step],
    results: dict[str, Any],
    timings: list[Timing],
    folder: Path | None,
    resume_from: str | None,
    advance: Any,
    planned: Plan,
) -> None:
    from fig2mesh.convert.stage_file import load_stage, save_stage

    why = {stage.name: stage.why for stage in planned.stages}
    first = 0 if resume_from is None else next(i for i, step in enumerate(road) if step.name == resume_from)
    timings += [Timing(each.name, 0.0, peak_mb(), each.why, runs=False) for each in planned.stages if not each.runs]
    for index, step in enumerate(road):
        advance(step.name)
        start = time.perf_counter()
        if index < first and step.kept:
            assert folder is not None
            results[step.name] = load_stage(folder, step.name)
            timings.append(Timing(step.name, time.perf_counter() - start, peak_mb(), "read from stages", runs=False))
            continue
        results[step.name] = step.run(*(results[name] for name in step.needs))
        timings.append(Timing(step.name, time.perf_counter() - start, peak_mb(), why[step.name]))
        log.debug("%s: %.2f s", step.name, timings[-1].seconds)
        if folder is not None and step.kept:
            save_stage(folder, step.name, results[step.name])


def _stages(folder: Path, figure: Figure, settings: Settings, normals: bool, resume_from: str | None) -> Path:
    """Make the folder of stages ready: empty of other runs, or checked to be of this one where it goes on."""
    from fig2mesh.convert.stage_file import clear_stages, figure_digest, load_stage, save_stage

    request = {"figure": figure_digest(figure), "normals": normals, **asdict(settings)}
    if resume_from is None:
        clear_stages(folder)
        save_stage(folder, REQUEST, request)
        return folder
    before = load_stage(folder, REQUEST)
    if resume_from == "cloud" and settings.mesher == "isosurface":
        raise InputError("--resume-from", "cloud is not run with --mesher isosurface", "choose another stage")
    if resume_from in COLOURING and settings.textures == "none":
        raise InputError("--resume-from", f"{resume_from} is not run with --textures none", "choose another stage")
    if before.get("figure") != request["figure"]:
        raise InputError("--resume-from", "the stages were made from another figure", "pass that figure, or run anew")
    start = STAGES.index(resume_from)
    for name, stage in FIRST_USE.items():
        if STAGES.index(stage) < start and before.get(name) != request[name]:
            found = f"the stages were made with {name} {before.get(name)}, not {request[name]}"
            raise InputError("--resume-from", found, f"start at {stage} or earlier")
    return folder


def tell(placed: Placed, *more: str | None) -> None:
    """Log what the user is to know of a place."""
    if placed.summary:
        log.info("%s", placed.summary)
    for note in (*placed.notes, *more):
        if note:
            log.warning("%s", note)


def _check_targets(
    targets: tuple[str, ...],
    name: str,
    lods: int,
    somewhere: bool,
    overwrite: bool,
    version: Any,
    client: Profile,
) -> None:
    for target in targets:
        if not somewhere and needs_place(target):
            kind = "3D Tiles need" if is_tileset(target) else f"{Path(target).suffix} needs"
            raise OutputError(target, f"{kind} a place on earth", "pass --lonlat LON LAT or --map SHEET")
    check_outputs(targets, overwrite=overwrite, name=name, lods=lods, tiles_version=version, profile=client)


def plan_of(*, figure: Path, outputs: tuple[str, ...], lods: int, **options: Any) -> Plan:
    """What `run` would do with the same options; reads and writes nothing."""
    targets = outputs or (figure.stem + ".glb",)
    levels = lods if any(has_levels(target) for target in targets) else 1
    options["lods"] = levels
    given = {name: options[name] for name in SETTING_OPTIONS}
    return plan(settings_of(device="cpu", **given), targets)


def check_text(path: Path, overwrite: bool, option: str = "--report") -> None:
    """Refuse a text file that could not be written; option : the one that names it."""
    if path.is_dir():
        raise OutputError(path, "is a folder", f"give {option} a file name")
    if path.exists() and not overwrite:
        raise OutputError(path, "exists", f"pass --overwrite or {_another(option)}")
    if not path.parent.is_dir():
        raise OutputError(path, f"no folder {path.parent}", "create it first")


def write_text(path: Path, text: str, option: str = "--report") -> None:
    """Write a text file, whole or not at all; option : the one that names it. Raises OutputError."""
    try:
        atomic_file.write_text(path, text)
    except OSError as error:
        raise OutputError(path, error.strerror or "cannot be written", f"choose {_another(option)}") from None


def _another(option: str) -> str:
    return "another name" if option == "-o" else f"another {option}"


def peak_mb() -> float:
    """Largest resident size of the process so far, MiB; 0 where the system does not tell."""
    try:
        import resource
    except ImportError:
        return 0.0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (1 << 20) if sys.platform == "darwin" else peak / 1024


def configure_logging(quiet: bool, verbose: int) -> None:
    """Messages to stderr, as many as asked for."""
    level = logging.ERROR if quiet else logging.DEBUG if verbose else logging.INFO
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(logging.Formatter("%(message)s"))
    log.handlers[:] = [handler]
    log.setLevel(level)
    log.propagate = False


@contextmanager
def progress(quiet: bool) -> Iterator[Any]:
    """A function that names the stage under way; a bar only on a terminal."""
    if quiet or not sys.stderr.isatty():
        yield lambda name: None
        return
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("start", total=None)
        yield lambda name: bar.update(task, description=name)
