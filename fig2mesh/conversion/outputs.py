"""Outputs of a request: checked before the work begins, written when it is done."""

from __future__ import annotations

from pathlib import Path

from exporters.asset import Asset
from exporters.profiles import profile_named
from exporters.tiles.tileset import TilesVersion, short_range_warning
from exporters.write import check_outputs, in_order, is_tileset, needs_place
from exporters.write import write as write_asset
from fig2mesh.conversion.convert import Conversion
from fig2mesh.conversion.observer import Observer
from fig2mesh.conversion.request import ProfileName, Request
from fig2mesh.conversion.text_file import check_text
from fig2mesh.errors import OutputError


def check_request(request: Request) -> None:
    """Check the outputs of a request before the work begins. Raises OutputError and ExportError."""
    client = profile_named(request.profile)
    client.check_tools()
    for target in request.targets:
        if not request.has_place:
            refuse_unplaced(target)
    check_outputs(
        request.targets,
        overwrite=request.overwrite,
        name=request.title,
        lods=request.lods,
        tiles_version=request.tiles_version,
        profile=client,
    )
    if request.report is not None:
        check_text(request.report, request.overwrite)


def write_outputs(asset: Asset, request: Request, observer: Observer) -> list[Path]:
    """Write an asset to all outputs of a request; returns the files. Raises ExportError."""
    written: list[Path] = []
    for target in in_order(request.targets):
        with observer.work(f"write {target}", "an output"):
            written += write_asset(
                asset,
                target,
                overwrite=request.overwrite,
                visible_from_m=request.visible_from,
                tiles_version=request.tiles_version,
                profile=profile_named(request.profile),
            )
    return written


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
    outputs : paths with the suffix of a format, or folders for 3D Tiles
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
    check_outputs(targets, overwrite, asset.name, len(asset.lods), tiles_version, profile_named(profile))
    written: list[Path] = []
    for target in in_order(targets):
        if asset.placement is None:
            refuse_unplaced(str(target))
        written += write_asset(asset, target, overwrite, visible_from, tiles_version, profile_named(profile))
    return tuple(written)


def refuse_unplaced(target: str) -> None:
    """Raise OutputError for an output whose format needs a place on the earth."""
    if needs_place(target):
        kind = "3D Tiles need" if is_tileset(target) else f"{Path(target).suffix} needs"
        raise OutputError(target, f"{kind} a place on the earth", "give --lonlat LON LAT or --map SHEET")


def near_note(request: Request, height_m: float) -> str | None:
    """Warning that a tileset's figure of that height is drawn only from too near, in one line; else None."""
    return short_range_warning(request.visible_from, height_m) if any(map(is_tileset, request.targets)) else None
