"""Writers by path. The files of an output are written atomically, the one that names the others last."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from exporters.asset import Asset
from exporters.atomic_file import write_whole
from exporters.errors import ExportError
from exporters.gis.czml import write_czml
from exporters.gis.geojson import write_geojson
from exporters.gltf.glb import write_glb, write_gltf
from exporters.obj import write_obj
from exporters.ply import write_ply
from exporters.profiles import GENERAL, Profile, suffix_of
from exporters.text import check_utf8
from exporters.tiles.tileset import TilesVersion, content_name, write_tileset
from exporters.usd.stage import texture_name, write_usd

OutputPath = str | os.PathLike[str]


@dataclass(frozen=True)
class Format:
    """An output format.

    title : display name
    writer : writes an asset to a path for the client of a profile
    companions : endings, after the stem, of further files written next to it; without the textures of USD, one for
        each level of detail
    placed : whether it needs a place on the earth
    """

    title: str
    writer: Callable[[Asset, Path, Profile], None]
    companions: tuple[str, ...] = ()
    placed: bool = False


TEXTURE = "_texture.png"
"""Ending of the texture of a model; not `.png` alone, as `figure.png` is usually the drawing itself."""


def _same_for_all(writer: Callable[[Asset, Path], None]) -> Callable[[Asset, Path, Profile], None]:
    return lambda asset, path, profile: writer(asset, path)


FORMATS: dict[str, Format] = {
    ".glb": Format("glTF 2.0 binary", write_glb),
    ".gltf": Format("glTF 2.0", write_gltf, (".bin", TEXTURE)),
    ".usda": Format("OpenUSD text", _same_for_all(write_usd)),
    ".usdc": Format("OpenUSD binary", _same_for_all(write_usd)),
    ".usdz": Format("OpenUSD package", _same_for_all(write_usd)),
    ".ply": Format("Stanford PLY", _same_for_all(write_ply)),
    ".obj": Format("Wavefront OBJ", _same_for_all(write_obj), (".mtl", TEXTURE)),
    ".czml": Format("CZML", write_czml, (".glb",), placed=True),
    ".geojson": Format("GeoJSON", write_geojson, (".glb",), placed=True),
}
"""File formats by suffix; a folder or a tileset.json means 3D Tiles."""


def is_tileset(path: OutputPath) -> bool:
    """Whether a path means 3D Tiles: no suffix, a trailing slash, an existing folder, or the name tileset.json."""
    text, file = os.fspath(path), Path(path)
    if text.endswith(("/", os.sep)) or file.name == "tileset.json" or not file.suffix:
        return True
    return file.is_dir() and file.suffix.lower() not in FORMATS  # such as maps/v1.2


def has_levels(path: OutputPath) -> bool:
    """Whether an output contains all levels of detail of an asset, not only the finest: 3D Tiles and USD."""
    return is_tileset(path) or Path(path).suffix.lower().startswith(".usd")


def needs_place(path: OutputPath) -> bool:
    """Whether an output cannot be written without a place on the earth: 3D Tiles, CZML, GeoJSON."""
    return is_tileset(path) or getattr(FORMATS.get(Path(path).suffix.lower()), "placed", False)


def in_order(paths: Iterable[OutputPath]) -> list[OutputPath]:
    """Sort the outputs of one asset for writing: models before the files that include them as companions."""
    return sorted(paths, key=lambda path: FORMATS.get(Path(path).suffix.lower(), FORMATS[".glb"]).placed)


def check_outputs(
    paths: Iterable[OutputPath],
    overwrite: bool = False,
    name: str = "",
    lods: int = 1,
    tiles_version: TilesVersion = "1.1",
    profile: Profile = GENERAL,
) -> frozenset[str]:
    """Check before the work begins that outputs can be written; returns absolute paths of all files they consist of.

    paths : all outputs of one asset
    overwrite : existing files may be replaced
    name, lods, tiles_version : of the asset, which determine the content files of a tileset.json
    profile : of the client that reads them

    Raises ExportError naming the first output with an unknown suffix, that the client does not read, in a folder that
    cannot be written to, that exists although `overwrite` is off, or that is given twice.
    """
    known: set[str] = set()
    parts: dict[str, Path] = {}
    for path in paths:
        main = _main_file(path)
        profile.check(os.fspath(path), suffix_of(main))
        check_file(path, main, overwrite)
        for companion in _companions(path, name, lods, tiles_version, profile):
            if companion.exists() and not overwrite:
                raise ExportError(
                    companion, f"already exists, a part of {main.name}", "use --overwrite or choose another name"
                )
            parts[os.path.abspath(companion)] = main
        key = os.path.abspath(main)
        if key in known:
            raise ExportError(os.fspath(path), "given twice", "give each output once")
        known.add(key)
    for key in known & set(parts):
        if parts[key].suffix.lower() in (".czml", ".geojson"):
            continue  # their model is the requested one
        raise ExportError(key, f"also a part of {parts[key]}", "choose another name or folder for one of them")
    return frozenset(known | set(parts))


def write(
    asset: Asset,
    path: OutputPath,
    overwrite: bool = False,
    visible_from_m: float | None = None,
    tiles_version: TilesVersion = "1.1",
    profile: Profile = GENERAL,
) -> tuple[Path, ...]:
    """Write an asset atomically in the format given by the path.

    asset : not changed
    path : a file with a suffix of `FORMATS`; a folder or its tileset.json for 3D Tiles. Missing folders are made
    overwrite : replace existing files; in the folder of a tileset only files of the same names
    visible_from_m, tiles_version : for 3D Tiles, see `exporters.tiles.tileset.write_tileset`
    profile : of the client of the file
    returns : the files written, the one that names the others last

    Raises ExportError as `check_outputs` does, where the profile needs a package that is not installed, and where the
    file cannot be written.
    """
    main = _main_file(path)
    profile.check(os.fspath(path), suffix_of(main))
    check_file(path, main, overwrite)

    def fill(stage: Path) -> None:
        if main.name == "tileset.json":
            write_tileset(asset, stage, visible_from_m, tiles_version, profile)
        else:
            FORMATS[main.suffix.lower()].writer(asset, stage / main.name, profile)

    return write_whole(path, main, fill, overwrite)


def _main_file(path: OutputPath) -> Path:
    if is_tileset(path):
        folder = Path(path)
        return folder if folder.name == "tileset.json" else folder / "tileset.json"
    file = Path(path)
    if file.suffix.lower() not in FORMATS:
        known = ", ".join(FORMATS)
        raise ExportError(os.fspath(path), f"unknown suffix {file.suffix!r}", f"use {known} or a folder for 3D Tiles")
    return file


def _companions(path: OutputPath, name: str, lods: int, version: TilesVersion, profile: Profile) -> list[Path]:
    if is_tileset(path):
        return [_main_file(path).with_name(content_name(name, lod, version)) for lod in range(lods)] if name else []
    file = Path(path)
    if file.suffix.lower() in (".usda", ".usdc"):
        return [file.with_name(texture_name(file.stem, lod)) for lod in range(lods)]
    endings = FORMATS[file.suffix.lower()].companions
    if file.suffix.lower() == ".gltf":
        endings = tuple(profile.texture_ending if ending == TEXTURE else ending for ending in endings)
    return [file.with_name(file.stem + ending) for ending in endings]


def check_file(path: OutputPath, main: Path, overwrite: bool) -> None:
    """Check that `main` can be written.

    path : the output as given by the user, for messages. Raises ExportError if it cannot.
    """
    name = os.fspath(path)
    check_utf8(path)
    if main.is_dir():
        raise ExportError(name, "a directory, not a file", "remove it or choose another name")
    if main.exists() and not overwrite:
        raise ExportError(main, "already exists", "use --overwrite or choose another name")
    ancestor = next(folder for folder in Path(os.path.abspath(main)).parents if os.path.lexists(folder))
    if not ancestor.is_dir():
        raise ExportError(name, f"{ancestor} is not a directory", "choose another folder")
    if not os.access(ancestor, os.W_OK | os.X_OK):
        raise ExportError(name, f"no permission to write to {ancestor}", "choose another folder")
