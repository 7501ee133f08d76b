"""Colours for the texture atlas (paper appendix C).

Every texel is a point of the surface. Where the drawing shows that point, it takes the drawing's own pixel; elsewhere
it takes the plain colours of its part, and where the drawing has contours, creases between limbs have its ink.
Visibility is determined by ray casting on the mesh itself: a ray from the point towards the viewer must not be
blocked, so that an arm in front of the chest does not smear onto it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.counters import count
from fig2mesh.field.body import Body
from fig2mesh.image_frame import ImageFrame
from fig2mesh.mesh.raycast import scene_of
from fig2mesh.records import ByteArray, FloatArray, Mesh, UvMesh
from fig2mesh.texture.sources import Sources

TURNED = -0.3
"""Threshold of the z of a triangle's normal, below which it is not visible whatever its smooth normal."""

SLANT, SLANT_SOFT = 0.3, 0.1
"""Threshold of the normal's z, below which a contour would be drawn out to three times its width and more, and its
softness."""

LINE_REACH = 0.8
"""Distance off the surface at which corners are detected, widths of the line."""

CORNER, CORNER_SOFT = 0.6, 0.2
"""A point lies in a corner where the field's value is below this share of the distance stepped, by a soft threshold."""

FACING_AWAY = 0.1
"""Range of the normal's z, centred on 0, over which colours of the near side give way to those of the far side."""

CLEARANCE = 2e-3
"""Distance off the surface at which rays start, FIGURE units, so that they do not hit the face they start from."""


@dataclass(frozen=True)
class Baked:
    """color : (S, S, 3) uint8 sRGB; observed : (S, S) uint8, 255 where the drawing showed the surface, else 0;
    covered : (S, S) bool, texels inside a chart (the others are padding)."""

    color: ByteArray
    observed: ByteArray
    covered: NDArray[np.bool_]


def bake(
    mesh: UvMesh,
    normals: FloatArray,
    face_parts: ByteArray,
    sources: Sources,
    frame: ImageFrame,
    size: int,
    body: Body | None = None,
    inset: FloatArray | None = None,
    bare: ByteArray | None = None,
    ribbon: Mesh | None = None,
) -> Baked:
    """Bake the atlas of a mesh in FIGURE.

    Parameters
    ----------
    normals : (V, 3) float32 unit normals at the vertices of `mesh.solid`
    face_parts : (F,) uint8 part label of every triangle
    size : texels along each side of the square texture
    body : its creases are inked where the drawing has contours; None: no ink
    inset : (V, 3) vertices of the surface that is shown, where it is not `mesh.solid`
    ribbon : shows the drawing's contour, at the texture coordinates `mesh.line_uv`; None: there is none
    bare : (H, W, 3) the drawing without the line along its rim, for points that it shows at a slant; None: as drawn
    """
    owner, weights = rasterise(mesh.uv, mesh.faces, size)
    covered = owner >= 0
    face = owner[covered]
    corners = mesh.solid.vertices[mesh.solid.faces].astype(np.float64)
    points = np.einsum("nk,nkd->nd", weights[covered], corners[face])
    normal = np.einsum("nk,nkd->nd", weights[covered], normals[mesh.solid.faces][face].astype(np.float64))
    count("texels", len(face))
    solid, shown = mesh.solid, points
    if inset is not None:
        solid = Mesh(inset, mesh.solid.faces)
        shown = np.einsum("nk,nkd->nd", weights[covered], inset[solid.faces].astype(np.float64)[face])
    visible = _visible(solid, face, shown, normal, sources.grazing)
    color = np.empty((len(face), 3))
    color[visible] = drawn_colours(sources, frame, shown[visible])
    if bare is not None:
        share = slant(normal[visible, 2])[:, None]
        color[visible] += share * (
            _bilinear(bare.astype(np.float32), frame.image_from_figure(shown[visible])) - color[visible]
        )
    hidden = ~visible
    color[hidden] = plain_colours(sources, frame, points[hidden], normal[hidden], face_parts[face[hidden]], body)
    image = np.zeros((size, size, 3), np.uint8)
    image[covered] = np.clip(np.round(color), 0, 255).astype(np.uint8)
    observed = np.zeros((size, size), np.uint8)
    observed[covered] = np.where(visible, 255, 0)
    if ribbon is not None and mesh.line_uv is not None:
        owner, weights = rasterise(mesh.line_uv, ribbon.faces, size)
        line = (owner >= 0) & ~covered
        corners = ribbon.vertices[ribbon.faces[owner[line]]].astype(np.float64)
        drawn = drawn_colours(sources, frame, np.einsum("nk,nkd->nd", weights[line], corners))
        image[line] = np.clip(np.round(drawn), 0, 255).astype(np.uint8)
        observed[line] = 255
        covered |= line
    # Padding: bilinear filtering and mipmaps reach beyond the charts.
    _, source = ndimage.distance_transform_edt(~covered, return_indices=True)
    return Baked(image[tuple(source)], observed[tuple(source)], covered)


def slant(z: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N,) share of the colour beside the contour at points with that z of their unit normals: 1 at a slant, else 0."""
    return np.clip((SLANT - z) / SLANT_SOFT + 0.5, 0.0, 1.0)


def drawn_faces(mesh: Mesh) -> NDArray[np.bool_]:
    """(F,) bool: triangles that face the viewer and are not occluded at their corners, middle and between."""
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    a, b, c = (corners[:, i] for i in range(3))
    flat = np.cross(b - a, c - a)
    visible = np.asarray(flat[:, 2] > 0)
    face = np.tile(np.flatnonzero(visible), len(_SAMPLES))
    points = np.einsum("lk,nkd->lnd", _SAMPLES, corners[visible]).reshape(-1, 3)
    visible[visible] = _visible(mesh, face, points, flat[face]).reshape(len(_SAMPLES), -1).all(axis=0)
    return visible


_SAMPLES = (
    np.array(
        [
            [1, 1, 1],
            [0.9, 0.05, 0.05],
            [0.05, 0.9, 0.05],
            [0.05, 0.05, 0.9],
            [1, 1, 0],
            [0, 1, 1],
            [1, 0, 1],
        ]
    )
    / np.array([3, 1, 1, 1, 2, 2, 2])[:, None]
)
"""Barycentric coordinates at which the visibility of triangles is tested."""


def _visible(
    mesh: Mesh,
    face: NDArray[np.integer],
    points: NDArray[np.float64],
    smooth: NDArray[np.float64],
    grazing: float = 0.0,
) -> NDArray[np.bool_]:
    """(N,) bool: points (with their smooth normals) visible to the viewer of the drawing, far away along +z.

    grazing : least z of the smooth normal
    """
    vertices, faces = mesh.vertices, mesh.faces
    a, b, c = (vertices[faces[:, i]].astype(np.float64) for i in range(3))
    flat = np.cross(b - a, c - a)
    flat /= np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-20)
    visible = (smooth[:, 2] > grazing) & (flat[face, 2] > TURNED)
    visible[visible] = visible_points(mesh, points[visible], flat[face[visible]])
    return np.asarray(visible)


def visible_points(mesh: Mesh, points: NDArray[np.float64], normals: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(N,) bool: points of a surface with nothing between them and the viewer of the drawing; normals : (N, 3) unit."""
    import open3d as o3d

    scene = scene_of(mesh.vertices, mesh.faces)
    start = points + CLEARANCE * normals
    rays = np.concatenate([start, np.broadcast_to([0.0, 0.0, 1.0], start.shape)], axis=1).astype(np.float32)
    return np.asarray(~scene.test_occlusions(o3d.core.Tensor.from_numpy(rays)).numpy())


def drawn_colours(sources: Sources, frame: ImageFrame, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 3) sRGB 0-255: colours of the drawing in front of points (N, 3), FIGURE."""
    return _bilinear(sources.seen, frame.image_from_figure(points))


def plain_colours(
    sources: Sources,
    frame: ImageFrame,
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    labels: ByteArray,
    body: Body | None,
) -> NDArray[np.float64]:
    """(N, 3) sRGB 0-255 of points that the drawing does not show: plain areas, and ink in the creases.

    points, normals : (N, 3) FIGURE; labels : (N,) of the part that each lies on
    body : its creases are inked where the drawing has contours; None: no ink
    """
    if sources.painted is not None:
        unit = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
        return sources.painted.colours(points, unit)
    pixels = frame.image_from_figure(points)
    color = np.empty((len(points), 3))
    for label in np.unique(labels):
        chosen = labels == label
        near = sources.plain.get(int(label), next(iter(sources.plain.values())))
        far = sources.back.get(int(label), near)
        at = pixels[chosen] * sources.plain_scale
        away = np.clip(0.5 - normals[chosen, 2:] / FACING_AWAY, 0.0, 1.0)
        color[chosen] = away * _bilinear(far, at) + (1.0 - away) * _bilinear(near, at)
    if body is not None and sources.pen is not None:
        ink = crease_ink(body, points, normals, sources.pen.width)[:, None]
        color += ink * (sources.pen.colour - color)
    return color


def crease_ink(
    body: Body, points: NDArray[np.float64], normals: NDArray[np.float64], width: float
) -> NDArray[np.float64]:
    """(N,) amount of ink on points of the surface: 1 in the corner between a limb and what it touches.

    Off a flat or round surface the distance grows by the distance stepped; in a corner other surfaces are nearer.

    width : of the line, FIGURE units
    """
    reach = LINE_REACH * width
    unit = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
    away = body.distance((points + reach * unit).astype(np.float32)).astype(np.float64)
    return np.clip((CORNER - away / reach) / CORNER_SOFT + 0.5, 0.0, 1.0)


def _bilinear(picture: NDArray[np.float32], pixels: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 3) colours at (N, 2) x, y in pixels with centres at +0.5; bilinear, extrapolated by the border."""
    x = np.clip(pixels[:, 0] - 0.5, 0, picture.shape[1] - 1)
    y = np.clip(pixels[:, 1] - 0.5, 0, picture.shape[0] - 1)
    x0, y0 = np.floor(x).astype(int), np.floor(y).astype(int)
    x1, y1 = np.minimum(x0 + 1, picture.shape[1] - 1), np.minimum(y0 + 1, picture.shape[0] - 1)
    fx, fy = (x - x0)[:, None], (y - y0)[:, None]
    top = picture[y0, x0] * (1 - fx) + picture[y0, x1] * fx
    bottom = picture[y1, x0] * (1 - fx) + picture[y1, x1] * fx
    return np.asarray(top * (1 - fy) + bottom * fy, np.float64)


def rasterise(
    uv: NDArray[np.float32], faces: NDArray[np.int32], size: int
) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Rasterise triangles: the one that covers each texel centre.

    Returns
    -------
    owner : (S, S) int32 triangle, -1 where none
    weights : (S, S, 3) float32 barycentric coordinates
    """
    from fig2mesh.mesh.raster_kernel import rasterise_triangles

    owner = np.full((size, size), -1, np.int32)
    weights = np.zeros((size, size, 3), np.float32)
    rasterise_triangles(uv.astype(np.float64) * size, faces, owner, weights)
    return owner, weights
