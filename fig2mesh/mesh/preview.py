"""Orthographic views of a finished model, rendered by ray casting.

For demonstrations, contact sheets and measures (`fig2mesh.measure.model`). It renders the exported triangles and their
texture, not the distance field, so it shows what a viewer of the file will show: with the outline, of which an inverted
hull shows the triangles whose front faces the viewer. The rays are those of `fig2mesh.mesh.raycast`, as in
`fig2mesh.render`; pixels lie on a plane in metres here, so that they can be a drawing's.

Views: yaw 0 shows the figure's front (camera at +Z of ASSET), yaw 90 its left side (camera at +X), 180 its
back; a positive pitch raises the camera. The plane of a view has two coordinates in metres through the ASSET origin:
to the viewer's right, and up. "VIEW" below: the viewer's right, up, towards the camera.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from exporters.asset import ByteArray, TexturedMesh, without_outline
from exporters.atomic_file import atomic_path
from exporters.sampling import sample
from fig2mesh.field.camera import axes
from fig2mesh.mesh.pixels import straight_bytes
from fig2mesh.mesh.raycast import MeshCaster, MeshHits, interpolated, shown_vertices

Mode = Literal["textured", "clay", "normals", "observed"]
Bounds = tuple[float, float, float, float]
Color = tuple[int, int, int]

LIGHT: Color = (246, 245, 242)
"""Background of sheets: lighter than the clay, darker than white paper, so that both keep an outline."""
CLAY = (206.0, 190.0, 174.0)
OBSERVED, INFERRED = (58.0, 128.0, 104.0), (226.0, 142.0, 62.0)
KEY_LIGHT = (-0.30, 0.45, 0.84)
"""VIEW; a head-light moved a little to the upper left, so that forms facing the camera still show relief."""
RAYS_AT_ONCE = 1 << 20
"""Rays per batch: about 150 MB of rays, hits and samples."""
PICTURES = {".png": "PNG", ".jpg": "JPEG", ".jpeg": "JPEG"}
"""Formats of previews by suffix."""
MARGIN = 0.04
"""Margin of a picture, share of its height."""


def view_bounds(mesh: TexturedMesh, yaw_deg: float, pitch_deg: float = 0.0) -> Bounds:
    """Left, bottom, right, top of the mesh and its outline in the plane of a view, metres."""
    flat = shown_vertices(mesh) @ axes(yaw_deg, pitch_deg)[:2].T
    (left, bottom), (right, top) = flat.min(axis=0).tolist(), flat.max(axis=0).tolist()
    return left, bottom, right, top


def render_mesh(
    mesh: TexturedMesh,
    *,
    yaw_deg: float,
    pitch_deg: float = 0.0,
    size: tuple[int, int] = (480, 640),
    mode: Mode = "textured",
    bounds: Bounds | None = None,
    background: Color | None = None,
    samples: int = 2,
) -> ByteArray:
    """Render an orthographic picture of a mesh.

    Parameters
    ----------
    mesh : ASSET
    yaw_deg, pitch_deg : direction of the camera, see above
    size : (width, height) of the picture, pixels
    mode : "textured" the texture's (else the vertices') colours without shading, and the outline; "clay" shaded and
        uncoloured; "normals" the VIEW normals as 127.5 (n + 1); "observed" green where the drawing showed the surface,
        orange where it is inferred. Attributes that the mesh lacks are shown as clay. All but "textured" show the
        surface as drawn, without outline.
    bounds : left, bottom, right, top of the picture's outer edges in the view's plane, metres; None: the whole mesh
        in the middle, with a margin
    background : sRGB; None: transparent
    samples : rays along each side of a pixel; their mean is its colour and their share of hits its coverage

    Returns
    -------
    (H, W, 4) uint8 sRGB, straight alpha
    """
    width, height = size
    if min(width, height, samples) < 1:
        raise ValueError(f"size and samples are {size} and {samples}, expected at least 1")
    left, bottom, right, top = _fitted(view_bounds(mesh, yaw_deg, pitch_deg), size) if bounds is None else bounds
    caster = MeshCaster(mesh if mode == "textured" else without_outline(mesh))
    view_from_asset = axes(yaw_deg, pitch_deg)
    centre = view_from_asset @ caster.centre
    x = ((left + (np.arange(width * samples) + 0.5) / (width * samples) * (right - left)) - centre[0]) / caster.unit
    y = ((top - (np.arange(height * samples) + 0.5) / (height * samples) * (top - bottom)) - centre[1]) / caster.unit

    picture = np.empty((height, width, 4), np.float64)
    rows = max(1, RAYS_AT_ONCE // (width * samples * samples))
    for first in range(0, height, rows):
        band = y[first * samples : (first + rows) * samples]
        fine = _shade_rays(caster, view_from_asset, x, band, mode).reshape(-1, samples, width, samples, 4)
        picture[first : first + rows] = fine.mean(axis=(1, 3), dtype=np.float64)
    return straight_bytes(picture, background)


def views_sheet(
    mesh: TexturedMesh | Sequence[TexturedMesh],
    drawing_rgba: ByteArray | None = None,
    *,
    mask: NDArray[np.bool_] | None = None,
    yaws: Sequence[float] = (0, 45, 90, 180),
    clay_yaws: Sequence[float] = (),
    height: int = 480,
    background: Color = LIGHT,
    samples: int = 2,
) -> ByteArray:
    """Contact sheet: the drawing and views of the model side by side, at one scale, feet on one line; one mesh per row.

    Parameters
    ----------
    mesh : ASSET; each row has its own scale, the mesh fills its height
    drawing_rgba : (H, W, 4) or (H, W, 3) uint8, shown at the model's scale
    mask : (H, W) bool, the figure's silhouette; None: opaque pixels
    yaws, clay_yaws : degrees; views with texture, then views as clay
    height : pixels of a row

    Returns
    -------
    (H, W, 3) uint8
    """
    rows = []
    for one in [mesh] if isinstance(mesh, TexturedMesh) else mesh:
        margin = max(1, round(MARGIN * height))
        inner = max(1, height - 2 * margin)
        _, bottom, _, top = view_bounds(one, 0.0)
        pixel = max(top - bottom, 1e-30) / inner
        cells = [] if drawing_rgba is None else [_drawing_cell(drawing_rgba, mask, inner, margin, background)]
        modes: list[tuple[float, Mode]] = [(yaw, "textured") for yaw in yaws] + [(yaw, "clay") for yaw in clay_yaws]
        for yaw, mode in modes:
            left, _, right, _ = view_bounds(one, yaw)
            width = max(1, int(np.ceil((right - left) / pixel))) + 2 * margin
            start = (left + right) / 2 - width * pixel / 2
            frame = (start, bottom - margin * pixel, start + width * pixel, bottom + (inner + margin) * pixel)
            size = (width, inner + 2 * margin)
            picture = render_mesh(
                one, yaw_deg=yaw, size=size, mode=mode, bounds=frame, background=background, samples=samples
            )
            cells.append(picture[..., :3])
        rows.append(np.concatenate(cells, axis=1))
    widest = max(row.shape[1] for row in rows)
    sheet = np.empty((sum(row.shape[0] for row in rows), widest, 3), np.uint8)
    sheet[:] = background
    start_row = 0
    for row in rows:
        sheet[start_row : start_row + row.shape[0], : row.shape[1]] = row
        start_row += row.shape[0]
    return sheet


def write_preview(
    mesh: TexturedMesh,
    path: Path | str,
    *,
    drawing_rgba: ByteArray | None = None,
    mask: NDArray[np.bool_] | None = None,
    height: int = 640,
) -> None:
    """Write front, oblique, side and back views (after the drawing, if given) as one picture, whole or not at all.

    mesh : ASSET; path : with a suffix of `PICTURES`; drawing_rgba : (H, W, 4) uint8; mask : (H, W) bool, the figure's
    silhouette; height : pixels. Raises OSError where the disk refuses.
    """
    from PIL import Image

    path = Path(path)
    sheet = views_sheet(mesh, drawing_rgba, mask=mask, height=height)
    with atomic_path(path) as partial:
        Image.fromarray(sheet).save(partial, PICTURES[path.suffix.lower()], quality=90)


def _fitted(bounds: Bounds, size: tuple[int, int]) -> Bounds:
    """Bounds with a margin, widened to the shape of the picture so that pixels are square."""
    left, bottom, right, top = bounds
    width, height = size
    free = 1 - 2 * MARGIN
    pixel = max((right - left) / (width * free), (top - bottom) / (height * free), 1e-30)
    x, y = (left + right) / 2, (bottom + top) / 2
    return x - pixel * width / 2, y - pixel * height / 2, x + pixel * width / 2, y + pixel * height / 2


def _shade_rays(
    caster: MeshCaster,
    view_from_asset: NDArray[np.float64],
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    mode: Mode,
) -> NDArray[np.float32]:
    """(len(y), len(x), 4) colour 0-255, zero where nothing is hit, and coverage 0 or 1; x, y in units of the caster."""
    right, up, back = view_from_asset
    origins = (x[:, None] * right + (y[:, None, None] * up + back)).astype(np.float32).reshape(-1, 3)
    hits = caster.cast(origins, np.broadcast_to(-back.astype(np.float32), origins.shape))
    result = np.zeros((len(origins), 4), np.float32)
    if len(hits.corners):
        result[hits.hit, :3] = _colours(caster, hits, view_from_asset, mode)
        result[hits.hit, 3] = 1.0
    return result


def _colours(
    caster: MeshCaster, hits: MeshHits, view_from_asset: NDArray[np.float64], mode: Mode
) -> NDArray[np.floating]:
    """(M, 3) colours 0-255 at the points hit."""
    if mode == "textured":
        colours = caster.colours(hits)
        if colours is not None:
            return colours
    normals = caster.normals(hits) @ view_from_asset.T
    if mode == "normals":
        return 127.5 * (normals + 1.0)
    # Half-Lambert: no side of the form is black.
    light = 0.5 + 0.5 * (normals @ (np.array(KEY_LIGHT) / np.linalg.norm(KEY_LIGHT)))[:, None]
    shade = 0.30 + 0.75 * light**1.5
    mesh = caster.mesh
    if mode == "observed" and mesh.observed is not None and mesh.uv is not None:
        share = sample(mesh.observed, interpolated(mesh.uv, hits))[:, :1] / 255.0
        base = share * np.array(OBSERVED) + (1 - share) * np.array(INFERRED)
    else:
        base = np.array(CLAY)
    return np.asarray(np.minimum(shade * base, 255.0))


def _drawing_cell(
    drawing: ByteArray, mask: NDArray[np.bool_] | None, inner: int, margin: int, background: Color
) -> ByteArray:
    """Crop the drawing to the figure, and scale it to `inner` pixels of height, on the cell's ground line."""
    from PIL import Image

    shown = mask if mask is not None else (drawing[..., 3] >= 128 if drawing.shape[2] == 4 else None)
    cell_height = inner + 2 * margin
    if shown is None or not shown.any():
        shown = np.ones(drawing.shape[:2], np.bool_)
    rows, columns = np.flatnonzero(shown.any(axis=1)), np.flatnonzero(shown.any(axis=0))
    image = Image.fromarray(drawing).convert("RGBA")
    scale = inner / float(rows[-1] + 1 - rows[0])
    width = max(1, round((columns[-1] + 1 - columns[0]) * scale)) + 2 * margin
    # Bounds of the cell on the drawing; background beyond the drawing's edges.
    left = (columns[0] + columns[-1] + 1) / 2 - width / scale / 2
    top = rows[0] - margin / scale
    box = np.rint([left, top, left + width / scale, top + cell_height / scale]).astype(int)
    canvas = Image.new("RGBA", (int(box[2] - box[0]), int(box[3] - box[1])), (*background, 255))
    canvas.alpha_composite(image.crop(tuple(box.tolist())))
    return np.asarray(canvas.convert("RGB").resize((width, cell_height), Image.Resampling.LANCZOS))
