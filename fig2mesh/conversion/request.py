"""A request: all inputs and options of a conversion, as a checked value.

The options of the command line and the columns of collections are read from these fields. Nothing heavy is imported.
"""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any, Literal

from exporters.file_names import figure_name
from exporters.text import plain_text
from fig2mesh.conversion.fields import check_fields, option, request_class
from fig2mesh.errors import InputError
from fig2mesh.settings import Closing, Contours, Mesher, Parts, Quality, Settings, Textures, settings_for
from fig2mesh.skeleton import FIGURE_HEIGHT

MAX_SEED = 2**31 - 1

Effect = Literal["light", "none"]
MapTransform = Literal["auto", "helmert", "affine", "poly1", "poly2", "poly3", "tps", "projective"]
ProfileName = Literal["cesiumjs", "cesiumjs-ktx2", "blender", "qgis", "omniverse"]
Device = Literal["auto", "cpu", "cuda"]
Evidence = Literal["parts", "pixels", "none"]


@request_class
class FigureFiles:
    """Files of one drawn figure; anything they do not provide is inferred from the picture."""

    figure: Path = option(kw_only=False, help="The picture.", argument=True, shared=False)
    mask: Path | None = option(
        default=None,
        metavar="PNG",
        shared=False,
        help="Silhouette, bright on dark. Default: the alpha channel, or else inferred.",
    )
    keypoints: Path | None = option(
        default=None, metavar="JSON", shared=False, help="The 21 joints. Default: inferred."
    )
    part_labels: Path | None = option(default=None, metavar="PNG", shared=False, help="Part label of each pixel.")
    bbox: tuple[int, int, int, int] | None = option(
        default=None, metavar="X0 Y0 X1 Y1", shared=False, help="Bounding box of the figure in the picture, pixels."
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
    """Place, heading and size of the figure."""

    lonlat: tuple[float, float] | None = option(
        default=None, metavar="LON LAT", shared=False, help="Longitude and latitude of the figure, WGS 84 degrees."
    )
    map: Path | None = option(
        default=None,
        metavar="SHEET",
        help="Take the place from a georeferenced map: a GeoTIFF; a picture with a world file, a .points file or a "
        "IIIF georeference annotation next to it; or one of these files.",
    )
    at: tuple[float, float] | None = option(
        default=None,
        metavar="X Y",
        shared=False,
        help="Pixel of SHEET where the feet stand. Default: the feet as drawn, if FIGURE is the sheet itself.",
    )
    size_from: Literal["height", "map"] = option(
        default="height",
        help="height: use --height-m; map: scale the figure by its drawn size and the scale of the map.",
    )
    map_transform: MapTransform = option(
        default="auto",
        help="Transformation fitted to the control points. auto: the one named in the file, or else affine.",
    )
    map_crs: str | None = option(
        default=None,
        metavar="CRS",
        help="Coordinate reference system of the sheet, such as EPSG:2056, if its files name none. For control points "
        "in longitude and latitude: the projection to fit in.",
    )
    facing: str = option(
        default="viewer",
        metavar="N|NE|…|DEG|viewer",
        help="Direction that the figure faces: N, NE, … or degrees clockwise from north. viewer: towards the reader "
        "of the map, or south without --map.",
    )
    height_m: float | None = option(
        default=None, metavar="M", default_text=str(FIGURE_HEIGHT), help="Height of the figure, metres."
    )
    altitude: float = option(default=0.0, metavar="M", help="Height of the feet above the datum, metres.")
    altitude_datum: str = option(
        default="ellipsoid", metavar="ellipsoid|egm96|GRIDFILE", help="Vertical datum of --altitude."
    )
    altitude_mode: Literal["absolute", "clamp"] = option(
        default="absolute",
        help="clamp: --altitude is above the client's terrain, in formats that support this (CZML).",
    )

    @property
    def has_place(self) -> bool:
        """Whether a place is requested."""
        return self.lonlat is not None or self.map is not None

    @property
    def place(self) -> PlaceRequest:
        """These fields alone."""
        return PlaceRequest(**{each.name: getattr(self, each.name) for each in fields(PlaceRequest)})


@request_class
class InferenceOptions:
    """Options for inferring fields and colours from a figure."""

    quality: Quality = option(default="standard", help="Preset for the resolution of all stages.")
    parts: Parts = option(
        default="network", help="Method for the shapes of parts: neural networks, or the outline and rules alone."
    )
    textures: Textures | None = option(
        default=None,
        help="Colours of sides that the drawing does not show: those of its rim go round (default). paper: four views "
        "painted by networks and blended, as in the paper, to compare with. none: no texture at all.",
    )
    contours: Contours = option(
        default="keep",
        help="Form of the line drawn round the figure. keep: a ribbon along the silhouette, right in every client. "
        "hull: an inverted hull, which shows the line from every side, for clients that cull back faces; others show "
        "a black figure. drop: no line, for clients that draw outlines themselves.",
    )
    device: Device = option(default="auto", help="Device on which neural networks run.")
    seed: int = option(default=0, low=0, high=MAX_SEED, metavar="N", help="Seed of all random choices.")

    def settings(self) -> Settings:
        """The preset of the quality, with the options given. Raises InputError where the device is missing."""
        given = {each.name: getattr(self, each.name, None) for each in fields(Settings)}
        given["light"] = self._light()
        return settings_for(self.quality, **{**given, "device": torch_device(self.device)})

    def _light(self) -> bool | None:
        return None


@request_class
class MeshOptions:
    """Options for meshing and texturing."""

    triangles: int | None = option(
        default=None,
        low=200,
        high=2_000_000,
        metavar="N",
        help="Number of triangles of the finest mesh. Default: by --quality.",
    )
    texture_size: int | None = option(
        default=None,
        low=64,
        high=8192,
        metavar="PX",
        help="Width and height of the texture, texels. Default: by --quality.",
    )
    lods: int = option(
        default=1, low=1, high=5, metavar="N", help="Number of levels of detail (3D Tiles and USD only)."
    )
    mesher: Mesher = option(default="ball-pivot", help="Meshing method.")
    closing: Closing = option(default="pymeshlab", help="Method for closing the holes left by ball pivoting.")
    effects: tuple[Effect, ...] = option(
        default=(),
        name="effect",
        help="light: clients light the surface (default without texture); none: they show it unlit.",
    )


@request_class
class OutputOptions:
    """Outputs, and options for writing them."""

    name: str | None = option(
        default=None,
        metavar="TEXT",
        shared=False,
        help="Name of the figure in the outputs. Default: FIGURE without its suffix; its folder, if that is only "
        "'image', 'IMG_0001' or the like.",
    )
    outputs: tuple[str, ...] = option(
        default=(),
        name="output",
        short="o",
        metavar="OUT",
        column=False,
        help="Output file: .glb .gltf .usda .usdc .usdz .ply .obj .czml .geojson; or a folder or tileset.json for "
        "3D Tiles; .png or .jpg: a picture of the model. Repeatable. Default: the figure's default name with the "
        "suffix .glb, in the current folder.",
    )
    profile: ProfileName | None = option(
        default=None,
        help="Write for one client: cesiumjs with compression (-ktx2: also KTX 2 textures), blender and qgis without "
        "extensions, omniverse as binary USD. Default: files that every client reads.",
    )
    visible_from: float | None = option(
        default=None,
        metavar="M",
        column=False,
        help="Distance at which clients begin to draw the figure, metres (3D Tiles only). Default: about 1,100 times "
        "its height.",
    )
    tiles_version: Literal["1.0", "1.1"] = option(
        default="1.1", column=False, help="Version of 3D Tiles. 1.0: content as .b3dm, for older clients."
    )
    credit: str = option(default="", metavar="TEXT", help="Attribution to store in the outputs.")
    evidence: Evidence = option(
        default="parts",
        help="How to store what the drawing shows: parts for part names and the share of each part, as glTF feature "
        "ids; pixels for a mask of the texture as well, which some clients are slow to read; none.",
    )
    force: bool = option(default=False, help="Convert pictures in which hardly a person is found, too.")
    save_stages: Path | None = option(
        default=None, metavar="DIR", column=False, help="Save the result of each stage in DIR."
    )
    resume_from: str | None = option(
        default=None,
        metavar="STAGE",
        column=False,
        help="Skip the stages before STAGE and load their results from the --save-stages folder (required).",
    )
    report: Path | None = option(
        default=None, metavar="JSON", column=False, help="Write a report: timings, memory, measures, versions, hashes."
    )
    overwrite: bool = option(default=False, column=False, help="Replace existing outputs.")


@request_class
class Request(FigureFiles, PlaceRequest, InferenceOptions, MeshOptions, OutputOptions):
    """The request to convert one figure from its files to its outputs. Raises InputError for invalid values."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._light()
        if "-" in self.outputs:
            raise InputError("-o -", "writing to stdout is not supported", "name a file or a folder")
        check_visible_from(self.visible_from)

    @property
    def targets(self) -> tuple[str, ...]:
        """The outputs, or the default output if none is named."""
        return self.outputs or (plain_text(figure_name(self.figure.absolute())) + ".glb",)

    @property
    def title(self) -> str:
        """Name of the figure."""
        return plain_text(self.name or figure_name(self.figure.absolute()))

    @property
    def files(self) -> tuple[Path, ...]:
        """The figure's files, the picture first."""
        given = (self.figure, self.mask, self.keypoints, self.part_labels)
        return tuple(path for path in given if path is not None)

    def _light(self) -> bool | None:
        others = [effect for effect in self.effects if effect != "none"]
        if "none" in self.effects and others:
            raise InputError("--effect", f"none cannot be combined with {others[0]}", "give one of them")
        return "light" in self.effects if self.effects else None


def check_visible_from(distance_m: float | None) -> None:
    """Raise InputError unless a value of --visible-from is a positive distance, or None."""
    if distance_m is not None and not 0 < distance_m < 1e9:
        raise InputError("--visible-from", f"{distance_m:g} m", "give a positive distance in metres")


def torch_device(name: str) -> str:
    """The device that --device names: "cpu" or "cuda"."""
    if name == "cpu":
        return "cpu"  # torch takes seconds to load
    import torch

    available = torch.cuda.is_available()
    if name == "cuda" and not available:
        raise InputError("--device", "no usable CUDA device", "use --device cpu or auto")
    return "cuda" if available else "cpu"
