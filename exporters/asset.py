"""Input of the exporters: a textured mesh, its levels of detail and its placement.

Arrays are in the ASSET frame (see `georef.frames`): metres, +Y up, front +Z, origin on the ground between the
feet. Records are frozen and their arrays read-only, so that a writer cannot change the input of the next one.
"""

from __future__ import annotations

import io
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from exporters.text import plain_texts
from georef.placement import GeoPlacement

FloatArray = NDArray[np.float32]
IntArray = NDArray[np.int32]
ByteArray = NDArray[np.uint8]


def frozen_array(array: Any, dtype: Any, shape: tuple[int | None, ...], name: str, finite: bool = True) -> NDArray[Any]:
    """Return a read-only, C-ordered copy of `array`, checked against `shape` (None: any length)."""
    result = np.array(array, dtype=dtype, order="C", copy=True)
    matches = len(shape) == result.ndim and all(
        expected is None or expected == actual for expected, actual in zip(shape, result.shape, strict=True)
    )
    if not matches:
        raise ValueError(f"{name}: shape is {result.shape}, expected {shape}")
    if finite and result.dtype.kind == "f" and not np.isfinite(result).all():
        raise ValueError(f"{name}: holds NaN or infinite values")
    result.flags.writeable = False
    return result


@dataclass(frozen=True)
class Texture:
    """An image in texture space.

    pixels : (H, W, 1|3|4) uint8, sRGB (or linear data for masks), row 0 at the top; alpha is straight.
    """

    pixels: ByteArray

    def __post_init__(self) -> None:
        pixels = frozen_array(self.pixels, np.uint8, (None, None, None), "pixels")
        if pixels.shape[2] not in (1, 3, 4):
            raise ValueError(f"pixels: {pixels.shape[2]} channels, expected 1, 3 or 4")
        object.__setattr__(self, "pixels", pixels)

    @cached_property
    def png(self) -> bytes:
        """The image as a PNG file; encoded once, as several writers embed the same texture."""
        from PIL import Image

        pixels = self.pixels[:, :, 0] if self.pixels.shape[2] == 1 else self.pixels
        stream = io.BytesIO()
        # Level 4 is where files stop shrinking: 2048 x 2048 in 0.2-0.8 s, 1 % larger than level 6 in 0.3-2.6 s.
        Image.fromarray(pixels).save(stream, "PNG", compress_level=4)
        return stream.getvalue()


@dataclass(frozen=True)
class OutlineMesh:
    """The drawn contour as a mesh beside the solid.

    vertices : (N, 3) float32, ASSET, metres
    faces : (M, 3) int32
    colors : (N, 3) uint8 sRGB, of the pen
    culled : True: an inverted hull, closed, whose faces point inwards and are to be shown from their front only (a
        client that does not cull back faces shows the whole figure in the pen's colour); False: a ribbon along the
        silhouette, visible from both sides
    surface : (S, 3) float32, ASSET, metres: the vertices of the unsplit solid before they were inset
    width_m : median width of the line, metres
    uv : (N, 2) float32, texture coordinates of a ribbon that shows the line as drawn, in the texture of its mesh; None:
        the line has the pen's colour
    """

    vertices: FloatArray
    faces: IntArray
    colors: ByteArray
    culled: bool
    surface: FloatArray
    width_m: float
    uv: FloatArray | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices", frozen_array(self.vertices, np.float32, (None, 3), "vertices"))
        object.__setattr__(self, "faces", frozen_array(self.faces, np.int32, (None, 3), "faces"))
        count = len(self.vertices)
        object.__setattr__(self, "colors", frozen_array(self.colors, np.uint8, (count, 3), "colors"))
        if self.uv is not None:
            object.__setattr__(self, "uv", frozen_array(self.uv, np.float32, (count, 2), "uv"))
        object.__setattr__(self, "surface", frozen_array(self.surface, np.float32, (None, 3), "surface"))
        if not len(self.faces):
            raise ValueError("faces: empty; a mesh without a contour has no outline")
        if self.faces.min() < 0 or self.faces.max() >= count:
            raise ValueError(f"faces: index {int(self.faces.max())} outside the {count} vertices")


@dataclass(frozen=True)
class TexturedMesh:
    """A closed triangle mesh whose vertices are split along texture seams.

    vertices : (V, 3) float32, ASSET, metres
    faces : (F, 3) int32, counter-clockwise seen from outside
    normals : (V, 3) float32, unit length; None: the mesh is unlit
    uv : (V, 2) float32 in [0, 1], v = 0 at image row 0 (the glTF convention); None: untextured
    texture : colours; None: untextured
    observed : one-channel texture, 255 where the drawing shows the surface, 0 where it is inferred
    colors : (V, 3) uint8 sRGB vertex colours (for formats without textures)
    parts : (V,) uint8 part label per vertex (`fig2mesh.skeleton.PART_NAMES`), 0 none
    solid_index : (V,) int32, the vertex of the unsplit solid for each vertex: faces mapped through it
        form a closed, oriented, manifold surface
    deviation_m : measured mean and maximum distance to the surface before simplification, metres
    outline : the drawn contour; `vertices` are then inset by its width. None: `vertices` are the surface as drawn
    """

    vertices: FloatArray
    faces: IntArray
    normals: FloatArray | None
    solid_index: IntArray
    uv: FloatArray | None = None
    texture: Texture | None = None
    observed: Texture | None = None
    colors: ByteArray | None = None
    parts: ByteArray | None = None
    deviation_m: tuple[float, float] = (0.0, 0.0)
    outline: OutlineMesh | None = None

    def __post_init__(self) -> None:
        def freeze(name: str, dtype: Any, shape: tuple[int | None, ...]) -> None:
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, frozen_array(value, dtype, shape, name))

        freeze("vertices", np.float32, (None, 3))
        freeze("faces", np.int32, (None, 3))
        count = len(self.vertices)
        freeze("normals", np.float32, (count, 3))
        freeze("solid_index", np.int32, (count,))
        freeze("uv", np.float32, (count, 2))
        freeze("colors", np.uint8, (count, 3))
        freeze("parts", np.uint8, (count,))
        if len(self.faces) and (self.faces.min() < 0 or self.faces.max() >= count):
            raise ValueError(f"faces: index {int(self.faces.max())} outside the {count} vertices")
        if self.texture is not None and self.uv is None:
            raise ValueError("texture: given without uv coordinates")
        if self.outline is not None and self.solid_index.max(initial=-1) >= len(self.outline.surface):
            raise ValueError(f"outline: its surface has only {len(self.outline.surface)} vertices")

    @property
    def shading_normals(self) -> FloatArray:
        """(V, 3) float32 `normals`, or area-weighted vertex normals where there are none."""
        if self.normals is not None:
            return self.normals
        corners = self.vertices.astype(np.float64)[self.faces]
        flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        at_solid = np.zeros((int(self.solid_index.max(initial=-1)) + 1, 3))
        np.add.at(at_solid, self.solid_faces.reshape(-1), np.repeat(flat, 3, axis=0))
        length = np.linalg.norm(at_solid, axis=1, keepdims=True)
        unit = np.where(length > 0, at_solid / np.maximum(length, 1e-300), [0.0, 0.0, 1.0])
        return unit[self.solid_index].astype(np.float32)

    @property
    def solid_faces(self) -> IntArray:
        """(F, 3) int32 faces of the unsplit solid."""
        return self.solid_index[self.faces]


def without_outline(mesh: TexturedMesh) -> TexturedMesh:
    """Return the mesh without its outline and with the surface as drawn, not inset; the mesh itself if it has none.

    For formats and levels of detail without outlines, and for measures of the solid.
    """
    if mesh.outline is None:
        return mesh
    return replace(mesh, vertices=mesh.outline.surface[mesh.solid_index], outline=None)


@dataclass(frozen=True)
class Asset:
    """One figure ready for the writers.

    name : identifier, used for node, prim and file names
    lods : finest first; at least one
    placement : its place on the earth; None: not georeferenced
    part_names : label → name for the labels that occur in `TexturedMesh.parts`
    copyright : attribution line, may be empty
    lit : True: clients shade the surface; False: they show its colours unlit, in formats that support it
    observed_pixels : whether the mask of observed texels is written, in formats that support it; the observed share of
        each part always is. Some clients (loaders.gl) read such a texture once per vertex, for minutes
    metadata : JSON-serialisable facts about the figure (source, seed, version, observed share ...)

    Texts are made representable in UTF-8, see `exporters.text`.
    """

    name: str
    lods: tuple[TexturedMesh, ...]
    placement: GeoPlacement | None = None
    part_names: dict[int, str] = field(default_factory=dict)
    copyright: str = ""
    lit: bool = False
    observed_pixels: bool = False
    metadata: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.lods:
            raise ValueError("lods: empty, expected at least one mesh")
        for name in ("name", "copyright", "metadata"):
            object.__setattr__(self, name, plain_texts(getattr(self, name)))

    @property
    def mesh(self) -> TexturedMesh:
        """The finest mesh."""
        return self.lods[0]
