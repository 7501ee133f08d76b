"""Records passed between stages: frozen, with read-only arrays.

The frame of every array is stated; the frames are defined in `georef.frames`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from exporters.asset import frozen_array
from fig2mesh.skeleton import LIMBS

FloatArray = NDArray[np.float32]
IntArray = NDArray[np.int32]
ByteArray = NDArray[np.uint8]
BoolArray = NDArray[np.bool_]

DepthOrder = Literal["front", "behind"]
"""In front of the rest of the body from the viewer's side, or behind it."""


class _Checked:
    """Mixin: freeze and check array fields in `__post_init__`."""

    def _put(self, name: str, dtype: Any, shape: tuple[int | None, ...], finite: bool = True) -> None:
        object.__setattr__(self, name, frozen_array(getattr(self, name), dtype, shape, name, finite))


@dataclass(frozen=True)
class Figure(_Checked):
    """One drawn figure, cut out.

    name : identifier, from the file name
    rgba : (H, W, 4) uint8, IMAGE; straight alpha; the picture as drawn
    mask : (H, W) bool, IMAGE; the silhouette with clothing, hair and held objects
    joints_px : (21, 2) float32, IMAGE, in the order of `JOINT_NAMES`
    visible : (21,) bool; False where a joint is hidden and its position a guess
    part_labels : (H, W) uint8, IMAGE, `PART_NAMES`; all 0 where the user gave none
    depth_order : limbs (of `LIMBS`) that the user placed in front of or behind the body; the others follow from the
        pose
    origin_px : (x, y) of its upper left corner in the picture that it was cut from, px of that picture
    step_px : pixels of that picture per pixel of its own
    doubts : what is unlikely about its files and about what was inferred, as text
    score : mean confidence of its joints, 0-1, where they were inferred, else None
    """

    name: str
    rgba: ByteArray
    mask: BoolArray
    joints_px: FloatArray
    visible: BoolArray
    part_labels: ByteArray
    depth_order: Mapping[str, DepthOrder] = field(default_factory=dict)
    origin_px: tuple[float, float] = (0.0, 0.0)
    step_px: float = 1.0
    doubts: tuple[str, ...] = ()
    score: float | None = None

    def __post_init__(self) -> None:
        self._put("rgba", np.uint8, (None, None, 4))
        height, width = self.rgba.shape[:2]
        self._put("mask", np.bool_, (height, width))
        self._put("joints_px", np.float32, (21, 2))
        self._put("visible", np.bool_, (21,))
        self._put("part_labels", np.uint8, (height, width))
        for limb, order in self.depth_order.items():
            if limb not in LIMBS or order not in get_args(DepthOrder):
                raise ValueError(f"depth_order: {limb!r}: {order!r}, expected {LIMBS} to be front or behind")

    def _repr_png_(self) -> bytes:
        """The figure without its background, as notebooks show it."""
        from io import BytesIO

        from PIL import Image

        stream = BytesIO()
        Image.fromarray(np.where(self.mask[..., None], self.rgba, np.uint8(0))).save(stream, "PNG")
        return stream.getvalue()


@dataclass(frozen=True)
class Pose3D(_Checked):
    """joints : (21, 3) float32, FIGURE."""

    joints: FloatArray

    def __post_init__(self) -> None:
        self._put("joints", np.float32, (21, 3))


@dataclass(frozen=True)
class PartSdf(_Checked):
    """The signed distance field of one part on a cubic grid.

    part : label, `PART_NAMES`
    grid : (n, n, n) float32 indexed [x, y, z], FIGURE units, negative inside; samples sit on the cube's faces:
        node i of an axis lies at centre - edge/2 + edge * i/(n-1)
    centre : (3,) float32, FIGURE
    edge : length of the cube's edge, FIGURE units
    observed : False where the drawing did not show the part
    """

    part: int
    grid: FloatArray
    centre: FloatArray
    edge: float
    observed: bool = True

    def __post_init__(self) -> None:
        self._put("grid", np.float32, (None, None, None))
        if len(set(self.grid.shape)) != 1 or self.grid.shape[0] < 2:
            raise ValueError(f"grid: shape is {self.grid.shape}, expected a cube of at least 2 nodes per edge")
        self._put("centre", np.float32, (3,))
        if not self.edge > 0:
            raise ValueError(f"edge: {self.edge}, expected a positive length")

    @property
    def spacing(self) -> float:
        """Distance between neighbouring nodes, FIGURE units."""
        return float(self.edge / (self.grid.shape[0] - 1))

    @property
    def origin(self) -> FloatArray:
        """(3,) position of node (0, 0, 0), FIGURE."""
        return (self.centre - np.float32(self.edge / 2)).astype(np.float32)


@dataclass(frozen=True)
class Rays(_Checked):
    """origins, directions : (N, 3) float32, FIGURE; directions have unit length."""

    origins: FloatArray
    directions: FloatArray

    def __post_init__(self) -> None:
        self._put("origins", np.float32, (None, 3))
        self._put("directions", np.float32, (len(self.origins), 3))


@dataclass(frozen=True)
class Hits(_Checked):
    """Intersections of rays with the surface.

    depth : (N,) float32, distance along the ray, FIGURE units; infinite where nothing is hit
    part_index : (N,) int32, index into `Body.parts` of the part hit; -1 where nothing is hit
    points, normals : (N, 3) float32, FIGURE; zeros where nothing is hit
    steps : (N,) int32, field evaluations spent on the ray
    """

    depth: FloatArray
    part_index: IntArray
    points: FloatArray
    normals: FloatArray
    steps: IntArray

    def __post_init__(self) -> None:
        self._put("depth", np.float32, (None,), finite=False)
        count = len(self.depth)
        self._put("part_index", np.int32, (count,))
        self._put("points", np.float32, (count, 3))
        self._put("normals", np.float32, (count, 3))
        self._put("steps", np.int32, (count,))

    @property
    def hit(self) -> BoolArray:
        """(N,) bool."""
        return self.part_index >= 0


@dataclass(frozen=True)
class PointCloud(_Checked):
    """points, normals : (N, 3) float32, FIGURE; part : (N,) uint8 label of the part each point lies on."""

    points: FloatArray
    normals: FloatArray
    part: ByteArray

    def __post_init__(self) -> None:
        self._put("points", np.float32, (None, 3))
        self._put("normals", np.float32, (len(self.points), 3))
        self._put("part", np.uint8, (len(self.points),))


@dataclass(frozen=True)
class Mesh(_Checked):
    """A triangle mesh.

    vertices : (V, 3) float32, FIGURE
    faces : (F, 3) int32, counter-clockwise as viewed from outside
    """

    vertices: FloatArray
    faces: IntArray

    def __post_init__(self) -> None:
        self._put("vertices", np.float32, (None, 3))
        self._put("faces", np.int32, (None, 3))
        if len(self.faces) and (self.faces.min() < 0 or self.faces.max() >= len(self.vertices)):
            raise ValueError(f"faces: index outside the {len(self.vertices)} vertices")


@dataclass(frozen=True)
class Surface(_Checked):
    """Attributes of a mesh besides its shape.

    normals : (V, 3) float32 of its vertices, FIGURE; None where they are not requested
    parts : (V,) uint8 label of the part nearest to each vertex
    deviation : mean and largest distance to the mesh it was simplified from, FIGURE units
    """

    normals: FloatArray | None
    parts: ByteArray
    deviation: tuple[float, float]

    def __post_init__(self) -> None:
        self._put("parts", np.uint8, (None,))
        if self.normals is not None:
            self._put("normals", np.float32, (len(self.parts), 3))


@dataclass(frozen=True)
class UvMesh(_Checked):
    """A mesh with a texture atlas; vertices are split along chart borders.

    solid : the closed mesh that was unwrapped
    faces : (F, 3) int32 into the split vertices, same order of triangles as `solid.faces`
    solid_index : (V,) int32, vertex of `solid` for each split vertex
    uv : (V, 2) float32 in [0, 1], v = 0 at image row 0
    atlas_size : (width, height) in texels the atlas was packed for
    line_uv : (L, 2) float32, the same of the vertices of a ribbon that shows the drawn contour; None: there is none
    """

    solid: Mesh
    faces: IntArray
    solid_index: IntArray
    uv: FloatArray
    atlas_size: tuple[int, int]
    line_uv: FloatArray | None = None

    def __post_init__(self) -> None:
        self._put("faces", np.int32, (len(self.solid.faces), 3))
        self._put("solid_index", np.int32, (None,))
        self._put("uv", np.float32, (len(self.solid_index), 2))
        if self.line_uv is not None:
            self._put("line_uv", np.float32, (None, 2))
        for name, count in (("faces", len(self.solid_index)), ("solid_index", len(self.solid.vertices))):
            indices = getattr(self, name)
            if indices.size and (indices.min() < 0 or indices.max() >= count):
                raise ValueError(f"{name}: index outside the {count} vertices")
