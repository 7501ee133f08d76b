"""Writer of Wavefront OBJ with its material library and texture.

http://paulbourke.net/dataformats/obj/  http://paulbourke.net/dataformats/mtl/

OBJ indexes positions, texture coordinates and normals separately, so positions are those of the unsplit solid: the
file is closed by its indices alone although its texture has seams.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from exporters.asset import Asset, without_outline
from exporters.georeference import georeference
from exporters.sampling import vertex_colors
from exporters.solid import solid_of, unit_normals


def write_obj(asset: Asset, path: Path | str) -> None:
    """Write the finest level of detail as .obj, if textured with `<stem>.mtl` and `<stem>_texture.png` next to it.

    asset : vertices in the ASSET frame (y up, metres); written with enough digits to restore the same float32
    path : the .obj file, replaced if it exists, as are the files next to it
    """
    path = Path(path)
    mesh = without_outline(asset.mesh)
    solid = solid_of(mesh)
    material = path.with_suffix(".mtl")

    head = ["# fig2mesh; metres, y up, front along +z"]
    if asset.copyright:
        head.append("# copyright: " + " ".join(asset.copyright.split()))
    if asset.placement is not None:
        head += [f"# {key}: {value}" for key, value in georeference(asset.placement).items()]
    if mesh.texture is not None:
        head.append(f"mtllib {material.name}")
    head.append("o " + "_".join(asset.name.split()))

    positions: NDArray[np.floating] = mesh.vertices[solid.first]
    colors = vertex_colors(mesh) if mesh.texture is None else None
    if colors is not None:
        # The common extension "v x y z r g b". Without a material, as readers would use its white as the colour.
        positions = np.hstack([positions, (colors[solid.first] / 255.0).astype(np.float32)])
    corners = np.stack([solid.faces, mesh.faces, mesh.faces], axis=2) + 1
    blocks = ["\n".join(head), _rows("v", positions)]
    if mesh.uv is not None:
        # v runs upwards here: row 0 of the image is v = 1.
        blocks.append(_rows("vt", np.stack([mesh.uv[:, 0], np.float32(1) - mesh.uv[:, 1]], axis=1)))
        template = "f %d/%d/%d %d/%d/%d %d/%d/%d"
    else:
        corners = corners[:, :, [0, 2]]
        template = "f %d//%d %d//%d %d//%d"
    blocks.append(_rows("vn", unit_normals(mesh.shading_normals)))
    if mesh.texture is not None:
        blocks.append("usemtl drawing")
        texture = path.with_name(f"{path.stem}_texture.png")
        texture.write_bytes(mesh.texture.png)
        # illum 0 is constant colour: shading is part of the drawing.
        lines = ["newmtl drawing", "Ka 0 0 0", "Kd 1 1 1", "Ks 0 0 0", "illum 0", f"map_Kd {texture.name}", ""]
        material.write_bytes("\n".join(lines).encode())
    blocks.append("\n".join(template % tuple(row) for row in corners.reshape(len(corners), -1).tolist()))
    path.write_bytes(("\n".join(blocks) + "\n").encode())


def _rows(word: str, values: NDArray[np.floating]) -> str:
    # Nine significant digits identify every float32.
    template = word + " %.9g" * values.shape[1]
    return "\n".join(template % tuple(row) for row in values.tolist())
