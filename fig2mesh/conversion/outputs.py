"""Outputs of a request: checked before the work begins, written when it is done."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from exporters.asset import Asset
from exporters.profiles import Profile, profile_named
from exporters.tiles.tileset import TilesVersion, short_range_warning
from exporters.write import check_file, check_outputs, in_order, is_tileset, needs_place
from exporters.write import write as write_asset
from fig2mesh.conversion.convert import Conversion
from fig2mesh.conversion.observer import Observer
from fig2mesh.conversion.request import ProfileName, Request
from fig2mesh.conversion.text_file import check_text
from fig2mesh.errors import OutputError
from fig2mesh.mesh.preview import PICTURES, write_preview


def check_request(request: Request) -> None:
    """Check the outputs of a request before the work begins. Raises OutputError and ExportError."""
    client = profile_named(request.profile)
    client.check_tools()
    if not request.has_place:
        for target in models_of(request.targets):
            refuse_unplaced(target)
    _check_files(request.targets, request.overwrite, request.title, request.lods, request.tiles_version, client)
    if request.report is not None:
        check_text(request.report, request.overwrite)
    inputs = {os.path.realpath(path) for path in (*request.files, *filter(None, [request.map]))}
    for target in (*request.targets, *([str(request.report)] if request.report else [])):
        if os.path.realpath(target) in inputs:
            raise OutputError(target, "is also an input", "choose another name for the output")


def _check_files(
    targets: Sequence[str], overwrite: bool, name: str, lods: int, tiles_version: TilesVersion, client: Profile
) -> None:
    """Check that models and pictures can be written, see `exporters.write.check_outputs`."""
    files = set(check_outputs(models_of(targets), overwrite, name, lods, tiles_version, client))
    for target in pictures_of(targets):
        check_file(target, Path(target), overwrite)
        if os.path.abspath(target) in files:
            raise OutputError(target, "given twice, or a part of another output", "choose another name")
        files.add(os.path.abspath(target))


def is_picture(target: str) -> bool:
    """Whether an output is a picture of the model, by its suffix."""
    return Path(target).suffix.lower() in PICTURES and not is_tileset(target)


def models_of(targets: Sequence[str]) -> list[str]:
    """Outputs that are models, in the order given."""
    return [target for target in targets if not is_picture(target)]


def pictures_of(targets: Sequence[str]) -> list[str]:
    """Outputs that are pictures of the model, in the order given."""
    return [target for target in targets if is_picture(target)]


def write_outputs(done: Conversion, request: Request, observer: Observer) -> list[Path]:
    """Write a model to all outputs of a request; returns the files. Raises ExportError and OutputError."""
    written: list[Path] = []
    for target in in_order(models_of(request.targets)):
        with observer.work(f"write {target}", "an output"):
            written += write_asset(
                done.asset,
                target,
                overwrite=request.overwrite,
                visible_from_m=request.visible_from,
                tiles_version=request.tiles_version,
                profile=profile_named(request.profile),
            )
    for target in pictures_of(request.targets):
        with observer.work(f"write {target}", "a picture of the model"):
            written.append(_write_picture(done, target))
    return written


def _write_picture(model: Conversion | Asset, target: str) -> Path:
    """Write a picture of the model, beside its drawing where this is known. Raises OutputError."""
    path = Path(target)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if isinstance(model, Asset):
            write_preview(model.mesh, path)
        else:
            figure = model.run.figure
            write_preview(model.asset.mesh, path, drawing_rgba=figure.rgba, mask=figure.mask)
    except OSError as error:
        raise OutputError(target, error.strerror or "cannot be written", "choose another name") from error
    return path


def write(
    model: Conversion | Asset,
    *outputs: str | Path,
    overwrite: bool = False,
    profile: ProfileName | None = None,
    visible_from: float | None = None,
    tiles_version: TilesVersion = "1.1",
) -> tuple[Path, ...]:
    """Write a model to files, each whole or not at all.

    Parameters
    ----------
    outputs : paths with the suffix of a format, or of a picture of the model (`fig2mesh.mesh.preview.PICTURES`), or
        folders for 3D Tiles
    overwrite : replace existing files
    profile, visible_from, tiles_version : as in `fig2mesh.Request`

    Returns
    -------
    the files written

    Raises
    ------
    InputError : an output has an unknown suffix, exists, needs a place, or the disk refuses
    """
    asset = model if isinstance(model, Asset) else model.asset
    targets = tuple(map(str, outputs))
    client = profile_named(profile)
    if asset.placement is None:
        for target in models_of(targets):
            refuse_unplaced(target)
    _check_files(targets, overwrite, asset.name, len(asset.lods), tiles_version, client)
    written: list[Path] = []
    for path in in_order(models_of(targets)):
        written += write_asset(asset, path, overwrite, visible_from, tiles_version, client)
    written += [_write_picture(model, target) for target in pictures_of(targets)]
    return tuple(written)


def refuse_unplaced(target: str) -> None:
    """Raise OutputError for an output whose format needs a place on the earth."""
    if needs_place(target):
        kind = "3D Tiles need" if is_tileset(target) else f"{Path(target).suffix} needs"
        raise OutputError(target, f"{kind} a place on the earth", "give --lonlat LON LAT or --map SHEET")


def near_note(request: Request, height_m: float) -> str | None:
    """Warning that a tileset's figure of that height is drawn only from too near, in one line; else None."""
    return short_range_warning(request.visible_from, height_m) if any(map(is_tileset, request.targets)) else None
