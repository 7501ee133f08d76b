"""Writer of Stanford PLY, binary little-endian, with vertex colours.

http://paulbourke.net/dataformats/ply/

PLY has no standard way to refer to a texture, so no vertex needs to be split: the unsplit solid is written, closed by
its indices alone, and each vertex gets the mean colour of its copies along texture seams.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from exporters.asset import Asset, without_outline
from exporters.georeference import georeference
from exporters.sampling import vertex_colors
from exporters.solid import solid_of, unit_normals


def write_ply(asset: Asset, path: Path | str) -> None:
    """Write the finest level of detail: position, normal, red, green, blue (if coloured), part (if labelled).

    asset : vertices in the ASSET frame (y up, metres), written unchanged as float32
    path : the .ply file, replaced if it exists
    """
    mesh = without_outline(asset.mesh)
    solid = solid_of(mesh)
    count = len(solid.first)
    copies = np.bincount(solid.vertex, minlength=count)

    def averaged(values: NDArray[Any]) -> NDArray[np.float64]:
        columns = [np.bincount(solid.vertex, weights=column, minlength=count) for column in values.T]
        return np.stack(columns, axis=1) / copies[:, None]

    normals = unit_normals(averaged(mesh.shading_normals).astype(np.float32))
    blocks: list[tuple[tuple[str, ...], str, str, NDArray[Any]]] = [
        (("x", "y", "z"), "<f4", "float", mesh.vertices[solid.first]),
        (("nx", "ny", "nz"), "<f4", "float", normals),
    ]
    colors = vertex_colors(mesh)
    if colors is not None:
        mean = np.rint(averaged(colors)).astype(np.uint8)
        blocks.append((("red", "green", "blue"), "u1", "uchar", mean))
    if mesh.parts is not None:
        blocks.append((("part",), "u1", "uchar", mesh.parts[solid.first][:, None]))

    fields = [(name, code, word, values[:, i]) for names, code, word, values in blocks for i, name in enumerate(names)]
    vertices = np.empty(count, dtype=[(name, code) for name, code, _, _ in fields])
    for name, _, _, values in fields:
        vertices[name] = values
    faces = np.empty(len(solid.faces), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, solid.faces

    header = ["ply", "format binary_little_endian 1.0", "comment generator fig2mesh"]
    if asset.copyright:
        header.append("comment copyright " + " ".join(asset.copyright.split()))
    if asset.placement is not None:
        header += [f"comment {key} {value}" for key, value in georeference(asset.placement).items()]
    header.append(f"element vertex {count}")
    header += [f"property {word} {name}" for name, _, word, _ in fields]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
    # Readers expect ASCII in the header, and some search for its end in comments too: an altered credit is better
    # than a file that does not open.
    lines = [line.replace("end_header", "end header") for line in header]
    text = "\n".join([*lines, "end_header", ""]).encode("ascii", "backslashreplace")
    Path(path).write_bytes(text + vertices.tobytes() + faces.tobytes())
