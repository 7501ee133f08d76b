"""Outputs of a request: checked before the work begins, written when it is done."""

from __future__ import annotations

from pathlib import Path

from exporters.asset import Asset
from exporters.profiles import profile_named
from exporters.tiles.tileset import too_near_note
from exporters.write import check_outputs, in_order, is_tileset, needs_place, write
from fig2mesh.convert.observer import Observer
from fig2mesh.convert.request import Request
from fig2mesh.convert.text_file import check_text
from fig2mesh.errors import OutputError


def check_request(request: Request) -> None:
    """Refuse what can be refused of a request's outputs. Raises OutputError and ExportError."""
    client = profile_named(request.profile)
    client.check_tools()
    for target in request.targets:
        if not request.somewhere and needs_place(target):
            kind = "3D Tiles need" if is_tileset(target) else f"{Path(target).suffix} needs"
            raise OutputError(target, f"{kind} a place on earth", "pass --lonlat LON LAT or --map SHEET")
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
            written += write(
                asset,
                target,
                overwrite=request.overwrite,
                visible_from_m=request.visible_from,
                tiles_version=request.tiles_version,
                profile=profile_named(request.profile),
            )
    return written


def near_note(request: Request, height_m: float) -> str | None:
    """One line where a tileset is drawn from too near for a figure of that height, else None."""
    return too_near_note(request.visible_from, height_m) if any(map(is_tileset, request.targets)) else None
