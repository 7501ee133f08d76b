"""Small intact files of every kind that is read: what damage starts from.

An input is a folder of files, of which the one with the stem "main" is given to the reader.
"""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from exporters.asset import TexturedMesh
from georef.placement import GeoPlacement
from tests.exporters.analytic import asset, capsule, gradient_texture, half_observed
from tests.georef.sheets import sheets

PLACE = GeoPlacement(8.5417, 47.3769, 455.34, "egm96", 135.0)
STEM = "main"
BESIDE = ".glb .bin .mtl .prj .png "
"""Suffixes of files that others name, those that may be main ones first."""


@dataclass(frozen=True)
class Input:
    """main : name of the file that a reader is given; files : name → bytes, subfolders with slashes."""

    main: str
    files: dict[str, bytes]

    def put(self, folder: Path) -> Path:
        """Write the files; returns the main one."""
        for name, data in self.files.items():
            target = folder / name
            if "/" in name:
                target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(data)
        return folder / self.main


def taken(folder: Path) -> Input:
    """The input that lies in a folder."""
    files = {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    mains = [name for name in files if name.startswith(f"{STEM}.")]
    # Of several, the one that names the others.
    return Input(min(mains, key=lambda name: (BESIDE.find(Path(name).suffix + " "), name)), files)


def alone(suffix: str, data: bytes) -> Input:
    """An input of one file."""
    return Input(STEM + suffix, {STEM + suffix: data})


def body(columns: int = 6, **changes: Any) -> TexturedMesh:
    """A capsule of few triangles with a texture of 8 x 8."""
    fields: dict[str, Any] = {"texture": gradient_texture(8), "observed": half_observed(8)}
    return capsule(columns, 1, **(fields | changes))


def pixels(height: int = 6, width: int = 9, bands: int = 4) -> np.ndarray:
    """(H, W, bands) uint8, every pixel another colour, the upper left corner transparent."""
    values = np.arange(height * width * bands).reshape(height, width, bands).astype(np.uint8) * 7
    if bands == 4:
        values[..., 3] = 255
        values[:2, :2, 3] = 0
    return values


def saved(image: Image.Image, kind: str, **options: Any) -> bytes:
    """The bytes of a picture file."""
    stream = io.BytesIO()
    image.save(stream, kind, **options)
    return stream.getvalue()


def pictures() -> Iterator[Input]:
    """Pictures of every format and mode that a drawing comes in."""
    rgba = Image.fromarray(pixels())
    rgb = rgba.convert("RGB")
    labels = Image.fromarray((pixels(bands=1)[..., 0] % 18).astype(np.uint8))
    for mode in ("1", "L", "LA", "P", "RGB", "RGBA", "I;16", "I", "F"):
        image = rgba.convert(mode) if mode not in ("I;16", "I", "F") else labels.convert(mode)
        if mode not in ("I", "F"):
            yield alone(".png", saved(image, "PNG"))
        if mode != "LA":
            yield alone(".tif", saved(image, "TIFF"))
    yield alone(".png", saved(labels, "PNG", icc_profile=b"no profile", dpi=(72, 72)))
    yield alone(".png", saved(rgba, "PNG", save_all=True, append_images=[rgba.rotate(90), rgba], duration=40))
    for compression in ("tiff_lzw", "tiff_adobe_deflate", "packbits", "jpeg", "raw"):
        yield alone(".tif", saved(rgb, "TIFF", compression=compression))
    exif = Image.Exif()
    exif[274] = 6
    yield alone(".jpg", saved(rgb, "JPEG", exif=exif))
    yield alone(".jpg", saved(rgb, "JPEG", progressive=True, subsampling=2, quality=40))
    yield alone(".jpg", saved(rgb.convert("CMYK"), "JPEG"))
    yield alone(".jpg", saved(rgb.convert("L"), "JPEG"))
    yield alone(".webp", saved(rgba, "WEBP", lossless=True))
    yield alone(".webp", saved(rgb, "WEBP", quality=40))
    yield alone(".webp", saved(rgba, "WEBP", save_all=True, append_images=[rgba.rotate(90)] * 3, duration=40))
    yield alone(".gif", saved(rgba, "GIF", save_all=True, append_images=[rgba.rotate(90)] * 3, loop=0))
    yield alone(".bmp", saved(rgb, "BMP"))
    yield alone(".bmp", saved(labels, "BMP"))
    yield alone(".ppm", saved(rgb, "PPM"))


def scans() -> Iterator[Input]:
    """Pictures that libvips reads a window of."""
    rgb = Image.fromarray(pixels(20, 24, 3))
    yield alone(".png", saved(rgb, "PNG"))
    yield alone(".jpg", saved(rgb, "JPEG"))
    yield alone(".webp", saved(rgb, "WEBP"))
    yield alone(".tif", saved(rgb, "TIFF", compression="tiff_lzw"))
    yield alone(".tif", saved(rgb, "TIFF", tiffinfo={322: 16, 323: 16}))
    yield alone(".gif", saved(rgb, "GIF"))


def joints() -> Iterator[Input]:
    """Joints files of all four formats."""
    from fig2mesh.parse.joint_writers import WRITERS
    from fig2mesh.skeleton import JOINT_NAMES

    points = np.arange(42, dtype=np.float32).reshape(21, 2) * 2 + 5
    ours = {name: [*point, 1] for name, point in zip(JOINT_NAMES, points.tolist(), strict=True)}
    document = {"width": 120, "height": 120, "keypoints": ours, "depth_order": {"l_arm": "front", "r_leg": "behind"}}
    yield alone(".json", json.dumps(document).encode())
    for kind, write in WRITERS.items():
        if kind != "fig2mesh":
            made = write(points, np.arange(21) % 5 > 0, (120, 120), "figure.png")
            yield alone(".json", json.dumps(made).encode())


def _file(make: Any) -> bytes:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a"
        make(path)
        return path.read_bytes()


SHEET_PNG = ("main.png", lambda: saved(Image.new("L", sheets.SIZE, 200), "PNG"))


def world_files() -> Iterator[Input]:
    """A picture's world file and .prj, the world file alone, and one with decimal commas."""
    import pyproj

    prj = pyproj.CRS(sheets.SWISS).to_wkt("WKT1_ESRI").encode()
    world = _file(sheets.world_file)
    picture = SHEET_PNG[1]()
    yield Input("main.pgw", {"main.pgw": world, "main.prj": prj, "main.png": picture})
    yield Input("main.pgw", {"main.pgw": _file(lambda p: sheets.world_file(p, comma=True)), "main.prj": prj})
    yield Input("main.png", {"main.png": picture, "main.pgw": world, "main.prj": b"EPSG:2056"})


def points_files() -> Iterator[Input]:
    """QGIS's control points: of a few and of many points."""
    for count in (4, 12):
        at = sheets.controls(count)
        yield alone(".points", _file(lambda p, at=at: sheets.points_file(p, at, sheets.swiss(at))))
        places = sheets.lonlat(sheets.swiss(at))
        yield alone(".points", _file(lambda p, at=at, places=places: sheets.points_file(p, at, places, "EPSG:4326")))


def annotations() -> Iterator[Input]:
    """IIIF georeference annotations, one for each transformation, and a page of one."""
    at = sheets.controls(12)
    places = sheets.lonlat(sheets.swiss(at))
    for transformation in (
        {"type": "polynomial", "options": {"order": 1}},
        {"type": "polynomial", "options": {"order": 2}},
        {"type": "polynomial", "options": {"order": 3}},
        {"type": "thinPlateSpline"},
        {"type": "projective"},
        {"type": "helmert"},
    ):
        made = sheets.annotation(at, places, transformation=transformation)
        yield alone(".json", json.dumps(made).encode())
    crs = {"definition": "+proj=lcc +lat_0=47 +lon_0=8 +lat_1=46 +lat_2=48"}
    page = {"type": "AnnotationPage", "items": [sheets.annotation(at, places, resourceCrs=crs)]}
    yield alone(".json", json.dumps(page).encode())


def geotiffs() -> Iterator[Input]:
    """TIFFs with a scale and a tie point, a matrix, and control points."""
    keys = (1, 1, 0, 4, 1024, 0, 1, 1, 1025, 0, 1, 1, 3072, 0, 1, 2056, 1026, 34737, 7, 0)
    m = sheets.matrix()
    matrix = (m[0, 0], m[0, 1], 0.0, m[0, 2], m[1, 0], m[1, 1], 0.0, m[1, 2], 0, 0, 0, 0, 0, 0, 0, 1)
    at = sheets.controls(6)
    points = [v for (x, y), (e, n) in zip(at, sheets.swiss(at), strict=True) for v in (x, y, 0.0, e, n, 0.0)]
    for tags in (
        {33550: (5.0, 5.0, 0.0), 33922: (0.0, 0.0, 0.0, 2_683_000.0, 1_247_000.0, 0.0)},
        {34264: tuple(map(float, matrix))},
        {33922: tuple(map(float, points))},
    ):
        yield alone(
            ".tif", saved(Image.new("1", sheets.SIZE), "TIFF", tiffinfo=tags | {34735: keys, 34737: "CH1903+|"})
        )


def height_grids() -> Iterator[Input]:
    """Geoid grids, GTX and GeoTIFF, about 8 degrees east and 47 north."""
    values = np.full((4, 5), 47.5, ">f4") + np.arange(5, dtype=">f4")
    yield alone(".gtx", struct.pack(">4d2i", 46.0, 7.0, 0.5, 0.5, 4, 5) + values.astype(">f4").tobytes())
    import rasterio

    shape: dict[str, Any] = {"height": 4, "width": 5, "count": 1, "dtype": "float32", "crs": "EPSG:4326"}
    transform = rasterio.transform.from_origin(6.75, 47.75, 0.5, 0.5)
    with rasterio.MemoryFile() as memory:
        with memory.open(driver="GTiff", transform=transform, **shape) as grid:
            grid.write(values.astype("<f4"), 1)
            grid.update_tags(TYPE="VERTICAL_OFFSET_GEOGRAPHIC_TO_VERTICAL")
        yield alone(".tif", memory.read())


def written(name: str, **changes: Any) -> Input:
    """A capsule, written by our own writer."""
    import tempfile

    from exporters.write import write

    fields: dict[str, Any] = {"lods": (body(),)}
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder) / "made"
        root.mkdir()
        if "/" in name:
            (root / name).parent.mkdir()
        write(asset(PLACE, **(fields | changes)), root / name)
        files = {p.relative_to(root).as_posix(): p.read_bytes() for p in root.rglob("*") if p.is_file()}
    if name == "tileset.json":
        files = {("main.json" if key == name else key): data for key, data in files.items()}
        name = "main.json"
    return Input(name, files)


def compressed_glb() -> Input:
    """A GLB with quantised, compressed buffer views."""
    import tempfile

    from exporters.profiles import PROFILES
    from exporters.write import write

    with tempfile.TemporaryDirectory() as folder:
        write(asset(PLACE, lods=(body(),)), Path(folder) / "main.glb", profile=PROFILES["cesiumjs"])
        return alone(".glb", (Path(folder) / "main.glb").read_bytes())


def foreign_gltf() -> Input:
    """A scene of nodes, strips, sparse and normalised accessors, as other programs write it."""
    import tempfile

    from tests.exporters.test_foreign_files import _gltf

    with tempfile.TemporaryDirectory() as folder:
        return alone(".gltf", _gltf(Path(folder) / "a.gltf").read_bytes())


def glbs() -> Iterator[Input]:
    """Binary glTF: with texture and parts, bare, compressed."""
    yield written("main.glb")
    yield written("main.glb", lods=(body(texture=None, uv=None, observed=None, parts=None),), part_names={})
    yield compressed_glb()


def gltfs() -> Iterator[Input]:
    """glTF with separate buffer and picture, and glTF of another program."""
    yield written("main.gltf")
    yield foreign_gltf()


def tilesets() -> Iterator[Input]:
    """Tilesets of one figure, with levels of detail, as b3dm, and of several figures."""
    import tempfile

    from exporters.tiles.gather import write_figures

    levels = (body(), body(4, deviation_m=(0.01, 0.05)))
    yield written("tileset.json")
    yield written("tileset.json", lods=levels)
    for version in ("1.1", "1.0"):
        with tempfile.TemporaryDirectory() as folder:
            root = Path(folder)
            (root / "main.glb").write_bytes(written("main.glb").files["main.glb"])
            write_figures([root / "main.glb"], root / "all", version=version)
            files = {p.relative_to(root / "all").as_posix(): p.read_bytes() for p in (root / "all").rglob("*.*")}
        files["main.json"] = files.pop("tileset.json")
        yield Input("main.json", files)


def b3dms() -> Iterator[Input]:
    """Batched 3D models."""
    from exporters.tiles.b3dm import b3dm_bytes

    yield alone(".b3dm", b3dm_bytes(written("main.glb").files["main.glb"], "a.glb"))


def entities() -> Iterator[Input]:
    """CZML and GeoJSON with their models."""
    yield written("main.czml")
    yield written("main.geojson")


def stages() -> Iterator[Input]:
    """USD: text, binary, package."""
    yield written("main.usda", lods=(body(), body(4, deviation_m=(0.01, 0.05))))
    yield written("main.usdc")
    yield written("main.usdz")


def triangle_files() -> Iterator[Input]:
    """PLY and OBJ, ours and plain ones."""
    yield written("main.ply")
    yield written("main.obj")
    cube = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n"
    quads = "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n"
    yield alone(".obj", (cube + quads).encode())
    head = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    head += "element face 4\nproperty list uchar int vertex_index\nend_header\n"
    yield alone(".ply", (head + "0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n").encode())


def models() -> Iterator[Input]:
    """Everything that is drawn as a model."""
    yield from (each for each in glbs() if b"meshopt" not in each.files[each.main])
    yield written("main.gltf")
    yield from triangle_files()


def stage_files() -> Iterator[Input]:
    """Files of `--save-stages` with small records, named by what they hold."""
    import tempfile

    from fig2mesh.conversion.stores import FolderStore
    from fig2mesh.mesh.solid import Meshing, Solid
    from fig2mesh.records import Mesh, PointCloud, Pose3D, UvMesh

    corner = np.eye(4, 3, dtype=np.float32)
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]], np.int32)
    mesh = Mesh(corner, faces)
    uv = UvMesh(mesh, faces, np.arange(4, dtype=np.int32), corner[:, :2], (8, 8))
    values: dict[str, Any] = {
        "lift": Pose3D(np.arange(63, dtype=np.float32).reshape(21, 3)),
        "cloud": PointCloud(corner, np.eye(3, dtype=np.float32)[[0, 1, 2, 0]], np.ones(4, np.uint8)),
        "solid": Solid(mesh, Meshing("ball-pivot", None, 1, 0)),
        "simplify": (mesh, mesh),
        "unwrap": (uv,),
        "request": {"figure": "0" * 64, "seed": 0, "voxel": 0.1, "mesher": "ball-pivot", "light": False},
    }
    for name, value in values.items():
        with tempfile.TemporaryDirectory() as folder:
            FolderStore(Path(folder)).write_file(name, value)
            data = (Path(folder) / f"{name}.npz").read_bytes()
        yield Input("main.npz", {"main.npz": data, "stage": name.encode()})


def weights() -> Iterator[Input]:
    """A safetensors file of a small network."""
    import tempfile

    import torch

    from fig2mesh.nets.weights import save

    net = torch.nn.Linear(3, 2)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.safetensors"
        save(path, net.state_dict(), {"network": "linear", "shape": {"inputs": 3, "outputs": 2}, "seed": 0})
        yield alone(".safetensors", path.read_bytes())
