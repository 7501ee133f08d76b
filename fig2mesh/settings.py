"""Settings of a conversion: the quality presets and everything that changes the result."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

Quality = Literal["draft", "standard", "fine"]
Mesher = Literal["ball-pivot", "isosurface"]
Closing = Literal["pymeshlab", "fill"]
Parts = Literal["network", "outline"]
Precision = Literal["float32", "bfloat16"]
Textures = Literal["wrap", "paper", "none"]
Contours = Literal["hull", "keep", "drop"]


@dataclass(frozen=True)
class Settings:
    """Parameters of the pipeline; lengths in FIGURE units (a figure is 1.79 high).

    canvas_px : longest side of the raster on which outlines are inflated
    voxel : spacing of the part grids
    part_nodes : nodes per edge of the grids on which the networks' fields are decoded
    precision : of the part networks' arithmetic
    spacing : distance between neighbouring points of the scan
    triangles : of the finest mesh
    texture_size : texels along each side of the square texture
    lods : number of levels of detail, the finest included; each has a quarter of the triangles of the one before
    mesher : method that turns the surface into a mesh
    closing : method that closes the holes left by ball pivoting
    parts : source of depths: networks, or rules and the outline alone
    textures : of sides that the drawing does not show: colours of the rim go round; the paper's, painted by networks in
        four views and blended by the normal; none at all
    contours : form of the line along the silhouette, if drawn: an inverted hull, a ribbon ("keep"), or none
    light : clients light the surface; without, they show its colours as they are
    normals : whether any output or effect needs shading normals, see `fig2mesh.conversion.plan`
    device : "cpu" or "cuda"
    seed : of everything random
    """

    canvas_px: int = 448
    voxel: float = 0.0075
    part_nodes: int = 32
    precision: Precision = "float32"
    spacing: float = 0.0085
    triangles: int = 20_000
    texture_size: int = 1024
    lods: int = 1
    mesher: Mesher = "ball-pivot"
    closing: Closing = "pymeshlab"
    parts: Parts = "network"
    textures: Textures = "wrap"
    contours: Contours = "keep"
    light: bool = False
    normals: bool = True
    device: str = "cpu"
    seed: int = 0

    @property
    def picture_px(self) -> int:
        """Approximate number of pixels to which the longer side of a drawing is reduced: no texture shows more."""
        return 2 * max(self.texture_size, 1024)


EFFECTS = ("light", "none")
"""Effects of the main command by name; `fig2mesh render` has more."""

PRESETS: dict[Quality, Settings] = {
    "draft": Settings(canvas_px=256, voxel=0.01, part_nodes=24, spacing=0.012, triangles=6_000, texture_size=512),
    "standard": Settings(),
    "fine": Settings(canvas_px=768, voxel=0.005, part_nodes=64, spacing=0.006, triangles=60_000, texture_size=2048),
}


def settings_for(quality: Quality, **changes: object) -> Settings:
    """A preset with the given fields replaced; fields that are None keep the preset's value.

    Unless given, a figure without colours is lit, as it would be a white silhouette otherwise.
    """
    given = {name: value for name, value in changes.items() if value is not None}
    given.setdefault("light", given.get("textures") == "none")
    return replace(PRESETS[quality], **given)  # type: ignore[arg-type]
