"""A request: everything that a conversion is asked for, as a value.

The options of the command line and the columns of collections are read from these fields. Nothing heavy is imported.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Literal

from fig2mesh.conversion.fields import check_fields, option, request_class
from fig2mesh.errors import InputError
from fig2mesh.settings import Closing, Contours, Mesher, Parts, Quality, Settings, Textures, settings_for
from fig2mesh.skeleton import FIGURE_HEIGHT

MAX_SEED = 2**31 - 1

Effect = Literal["light", "none"]
MapTransform = Literal["auto", "helmert", "affine", "poly1", "poly2", "poly3", "tps", "projective"]
ProfileName = Literal["cesiumjs", "cesiumjs-ktx2", "blender", "qgis", "omniverse"]
Device = Literal["auto", "cpu", "cuda"]


@request_class
class FigureFiles:
    """Files of one drawn figure; what none of them gives is inferred from the picture."""

    figure: Path = option(kw_only=False, help="The picture.", argument=True, shared=False)
    mask: Path | None = option(
        default=None,
        metavar="PNG",
        shared=False,
        help="Silhouette, bright on dark; default: the alpha channel, or inferred.",
    )
    keypoints: Path | None = option(
        default=None, metavar="JSON", shared=False, help="The 21 joints; default: inferred."
    )
    part_labels: Path | None = option(default=None, metavar="PNG", shared=False, help="Part label of every pixel.")
    bbox: tuple[int, int, int, int] | None = option(
        default=None, metavar="X0 Y0 X1 Y1", shared=False, help="Part of the picture that holds the figure."
    )

    def __post_init__(self) -> None:
        check_fields(self)

    def reading(self) -> dict[str, Any]:
        """Arguments of `fig2mesh.parse.read.read_figure`."""
        return {
            "path": self.figure,
            "mask": self.mask,
            "keypoints": self.keypoints,
            "part_labels": self.part_labels,
            "bbox": self.bbox,
        }


@request_class
class PlaceRequest:
    """Where the figure stands, which way it looks and how large it is."""

    lonlat: tuple[float, float] | None = option(
        default=None, metavar="LON LAT", shared=False, help="Place on WGS 84, degrees."
    )
    map: Path | None = option(
        default=None,
        metavar="SHEET",
        help="Place from a georeferenced map instead: its picture with tags, a world file, .points or a IIIF "
        "annotation beside it; or one of these files.",
    )
    at: tuple[float, float] | None = option(
        default=None,
        metavar="X Y",
        shared=False,
        help="Pixel of SHEET where the feet are; default: where they are drawn, if FIGURE is the sheet.",
    )
    size_from: Literal["height", "map"] = option(
        default="height", help="map: as large on the globe as drawn on the map, in place of --height-m."
    )
    map_transform: MapTransform = option(
        default="auto", help="Fitted to control points; auto: as the file says, or affine."
    )
    map_crs: str | None = option(
        default=None,
        metavar="CRS",
        help="Reference system of the sheet, such as EPSG:2056, where its files name none; for points in longitude "
        "and latitude, the projection to fit in.",
    )
    facing: str = option(
        default="viewer",
        metavar="N|NE|…|DEG|viewer",
        help="Compass bearing of the nose; viewer: towards the reader of the map, south without --map.",
    )
    height_m: float | None = option(
        default=None, metavar="M", default_text=str(FIGURE_HEIGHT), help="Height of the figure."
    )
    altitude: float = option(default=0.0, metavar="M", help="Height of the feet.")
    altitude_datum: str = option(
        default="ellipsoid", metavar="ellipsoid|egm96|GRIDFILE", help="What --altitude is measured from."
    )
    altitude_mode: Literal["absolute", "clamp"] = option(
        default="absolute",
        help="clamp: --altitude is above the terrain that a client shows, where the format can say so (CZML).",
    )

    @property
    def has_place(self) -> bool:
        """Whether a place is asked for."""
        return self.lonlat is not None or self.map is not None

    @property
    def place(self) -> PlaceRequest:
        """These fields alone."""
        return PlaceRequest(**{each.name: getattr(self, each.name) for each in fields(PlaceRequest)})


@request_class
class InferenceOptions:
    """How a figure becomes fields and colours."""

    quality: Quality = option(default="standard", help="Resolution of all stages at once.")
    parts: Parts = option(default="network", help="What depths come from: networks, or rules and the outline alone.")
    textures: Textures | None = option(
        default=None,
        help="Unseen sides as networks paint them (default), or in the plain colours of what is drawn before them "
        "(default with --parts outline); or no texture at all.",
    )
    contours: Contours = option(
        default="keep",
        help="The line drawn around the figure: on the surface, like the drawing from the front and a dark band from "
        "the side; or left away, for clients that draw silhouettes.",
    )
    device: Device = option(default="auto", help="Where networks run.")
    seed: int = option(default=0, low=0, high=MAX_SEED, metavar="N", help="Of everything random.")

    def settings(self) -> Settings:
        """The preset of the quality with what is asked for besides. Raises InputError where the device is missing."""
        given = {each.name: getattr(self, each.name, None) for each in fields(Settings)}
        given["light"] = self._light()
        return settings_for(self.quality, **{**given, "device": torch_device(self.device)})

    def _light(self) -> bool | None:
        return None


@request_class
class MeshOptions:
    """How fields and colours become a textured mesh."""

    triangles: int | None = option(
        default=None, low=200, high=2_000_000, metavar="N", help="Triangles of the finest mesh."
    )
    texture_size: int | None = option(default=None, low=64, high=8192, metavar="PX", help="Texels a side.")
    lods: int = option(default=1, low=1, high=5, metavar="N", help="Levels of detail (3D Tiles, USD).")
    mesher: Mesher = option(default="ball-pivot", help="How the surface becomes a mesh.")
    closing: Closing = option(default="pymeshlab", help="What closes the holes that ball pivoting leaves.")
    effects: tuple[Effect, ...] = option(
        default=(),
        name="effect",
        help="light: clients light the surface (default without texture); none: they show it as it is. Repeatable.",
    )


@request_class
class OutputOptions:
    """What is written, for whom, and what is kept besides."""

    name: str | None = option(
        default=None,
        metavar="TEXT",
        shared=False,
        help="What the figure is called in the outputs; default: FIGURE's stem.",
    )
    outputs: tuple[str, ...] = option(
        default=(),
        name="output",
        short="o",
        metavar="OUT",
        column=False,
        help=".glb .gltf .usda .usdc .usdz .ply .obj .czml .geojson, or a folder / tileset.json for 3D Tiles; "
        "repeatable. Default: FIGURE's stem + .glb in the current folder.",
    )
    profile: ProfileName | None = option(
        default=None,
        help="Write for one client: cesiumjs compressed (also with KTX 2 texture), blender and qgis without "
        "extensions, omniverse as binary USD. Default: what every client takes.",
    )
    visible_from: float | None = option(
        default=None,
        metavar="M",
        column=False,
        help="Distance from which the figure is drawn, 3D Tiles only; default: about 1,100 times its height.",
    )
    tiles_version: Literal["1.0", "1.1"] = option(
        default="1.1", column=False, help="Of 3D Tiles; 1.0: content as .b3dm, for older clients."
    )
    credit: str = option(default="", metavar="TEXT", help="Attribution, kept in the outputs.")
    evidence: bool = option(
        default=True, help="Part names and how much of each the drawing showed, as glTF feature ids."
    )
    save_stages: Path | None = option(default=None, metavar="DIR", column=False, help="Keep what each stage made.")
    resume_from: str | None = option(
        default=None, metavar="STAGE", column=False, help="Start at STAGE with what --save-stages DIR holds."
    )
    report: Path | None = option(
        default=None, metavar="JSON", column=False, help="Seconds, memory, measures, versions, hashes."
    )
    overwrite: bool = option(default=False, column=False, help="Replace existing outputs.")


@dataclass(frozen=True)
class Request(FigureFiles, PlaceRequest, InferenceOptions, MeshOptions, OutputOptions):
    """One figure from its files to its outputs. Raises InputError for values that no conversion can have."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._light()
        check_visible_from(self.visible_from)

    @property
    def targets(self) -> tuple[str, ...]:
        """The outputs, with the default where none is named."""
        return self.outputs or (self.figure.stem + ".glb",)

    @property
    def title(self) -> str:
        """What the figure is called."""
        return self.name or self.figure.stem

    @property
    def files(self) -> tuple[Path, ...]:
        """The figure's files, the picture first."""
        given = (self.figure, self.mask, self.keypoints, self.part_labels)
        return tuple(path for path in given if path is not None)

    def _light(self) -> bool | None:
        others = [effect for effect in self.effects if effect != "none"]
        if "none" in self.effects and others:
            raise InputError("--effect", f"none beside {others[0]}", "give either none or the effects wanted")
        return "light" in self.effects if self.effects else None


def check_visible_from(distance_m: float | None) -> None:
    """Refuse a distance to be seen from that is none. Raises InputError."""
    if distance_m is not None and not 0 < distance_m < 1e9:
        raise InputError("--visible-from", f"{distance_m:g} m", "give a distance in metres")


def torch_device(name: str) -> str:
    """The device that --device names: "cpu" or "cuda"."""
    if name == "cpu":
        return "cpu"  # torch takes seconds to load
    import torch

    available = torch.cuda.is_available()
    if name == "cuda" and not available:
        raise InputError("--device", "no usable CUDA device", "pass --device cpu or auto")
    return "cuda" if available else "cpu"
