"""Measures of a finished model: likeness of its front to the drawing, and shape as a solid.

Everything is measured on the triangles and texture that were exported; `load_textured` reads them back from the file.

Pixel scale and origin relate the drawing to the model: pixel (x, y) of IMAGE, centres at +0.5, is
X = (x - x0) * metres_per_pixel, Y = (y0 - y) * metres_per_pixel of ASSET, with (x0, y0) = `origin_px` the position of
the ASSET origin on the drawing.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from exporters.asset import ByteArray, Texture, TexturedMesh
from exporters.colour import srgb_from_linear
from exporters.errors import ExportError
from exporters.gltf.outline import outline_form
from exporters.gltf.outline_reader import read_outline
from exporters.gltf.reader import read_gltf
from exporters.solid import merged_by_position, solid_of, unit_normals
from exporters.triangles.files import check_triangle_file
from fig2mesh.mesh.preview import render_mesh, view_bounds

BoolArray = NDArray[np.bool_]

SSIM_WINDOW = 7
MAX_SIDE_PX = 1536
"""Of larger figures only every second, third ... pixel is measured: all would cost seconds and gigabytes."""
MAX_PSNR_DB = 100.0
"""PSNR of identical pictures in reports: the true value is infinite, which JSON cannot represent."""


@dataclass(frozen=True)
class FrontSimilarity:
    """Similarity of the model's front and the drawing, over the pixels that both cover.

    psnr_db : peak signal-to-noise ratio of the sRGB values, dB, at most `MAX_PSNR_DB`
    ssim : mean structural similarity of the three channels, 7 × 7 windows, 1 where identical
    """

    psnr_db: float
    ssim: float


@dataclass(frozen=True)
class FrontOverlap:
    """The drawn silhouette and the model's front, (h, w) bool, at every step-th pixel of the drawing from `corner`."""

    drawn: BoolArray
    modelled: BoolArray
    corner: tuple[int, int]
    step: int


def silhouette_iou(
    mesh: TexturedMesh, mask: BoolArray, *, metres_per_pixel: float, origin_px: tuple[float, float]
) -> float:
    """Intersection over union of the model's front silhouette and the drawn one, at the drawing's pixel centres.

    mesh : ASSET, with its outline if it has one; mask : (H, W) bool, IMAGE. Parts of the model outside of the drawing
    count against it.
    """
    if not mask.any():
        return 0.0
    found = front_overlap(mesh, mask, metres_per_pixel=metres_per_pixel, origin_px=origin_px)
    # Coarse rows can miss lines of one pixel's width altogether.
    return float((found.drawn & found.modelled).sum() / max(int((found.drawn | found.modelled).sum()), 1))


def front_overlap(
    mesh: TexturedMesh,
    mask: BoolArray,
    *,
    metres_per_pixel: float,
    origin_px: tuple[float, float],
    max_side_px: int = MAX_SIDE_PX,
) -> FrontOverlap:
    """Drawn silhouette, which is not empty, and model; arguments as of `silhouette_iou`.

    max_side_px : of larger figures only every second, third ... pixel is compared
    """
    (x0, y0), (x1, y1) = box_of(mask)
    left, bottom, right, top = (edge / metres_per_pixel for edge in view_bounds(mesh, 0.0))
    model = np.array([[origin_px[0] + left, origin_px[1] - top], [origin_px[0] + right, origin_px[1] - bottom]])
    # A model that extends by more than the figure's size on each side has a wrong scale or position: the rest of it is
    # not counted, since the result is below a fifth anyway.
    width, height = x1 - x0, y1 - y0
    u0, v0 = np.clip(np.floor(model[0]), (x0 - width, y0 - height), (x0, y0)).astype(int).tolist()
    u1, v1 = np.clip(np.ceil(model[1]), (x1, y1), (x1 + width, y1 + height)).astype(int).tolist()
    step = -(-max(width, height) // max_side_px)
    drawn = every_step(mask, (u0, v0, u1, v1), step)
    origin = coarse_point(origin_px, (u0, v0), step)
    size = drawn.shape[1], drawn.shape[0]
    # Of the modes, only "textured" shows the outline.
    visible = front_pixels(mesh, size, step * metres_per_pixel, origin, 1, "textured")[..., 3] > 0
    return FrontOverlap(drawn, visible, (u0, v0), step)


def front_similarity(
    mesh: TexturedMesh,
    rgba: ByteArray,
    mask: BoolArray,
    *,
    metres_per_pixel: float,
    origin_px: tuple[float, float],
    background: tuple[int, int, int] = (255, 255, 255),
    samples: int = 1,
) -> FrontSimilarity:
    """Compare the textured front with the drawing, pixel by pixel, both on the same background.

    Parameters
    ----------
    mesh : ASSET, with its outline if it has one
    rgba : (H, W, 4) uint8, IMAGE; straight alpha, opaque for scans
    mask : (H, W) bool, IMAGE; the figure in the drawing
    background : sRGB, behind both
    samples : rays along each side of a pixel. One, through its centre, returns the drawing's own pixels where the
        texture contains them; 2 also measures the blur of the box filter (pen drawing, exact texture: 29 dB instead of
        100, SSIM lower by 0.013).
    """
    from skimage.metrics import structural_similarity

    if not mask.any():
        return FrontSimilarity(0.0, 0.0)
    (x0, y0), (x1, y1) = box_of(mask)
    step = -(-max(x1 - x0, y1 - y0) // MAX_SIDE_PX)
    # A border wider than half a window: drawings may touch their picture's edge, and may be smaller than a window.
    border = SSIM_WINDOW * step
    edges = x0 - border, y0 - border, x1 + border, y1 + border
    mask, rgba = every_step(mask, edges, step), every_step(rgba, edges, step)
    alpha = rgba[..., 3:].astype(np.float32) / 255 * _soft_figure(mask, rgba[..., 3])[..., None]
    ground = np.array(background, np.float32)
    drawn = np.rint(rgba[..., :3] * alpha + ground * (1 - alpha)).astype(np.uint8)
    origin = coarse_point(origin_px, edges[:2], step)
    size = mask.shape[1], mask.shape[0]
    front = front_pixels(mesh, size, step * metres_per_pixel, origin, samples, "textured")
    cover = front[..., 3:].astype(np.float32) / 255
    shown = np.rint(front[..., :3] * cover + ground * (1 - cover)).astype(np.uint8)
    both = mask & (front[..., 3] >= 128)
    if not both.any():
        return FrontSimilarity(0.0, 0.0)
    error = float(np.mean((drawn[both].astype(np.float64) - shown[both]) ** 2))
    psnr = MAX_PSNR_DB if error == 0 else min(MAX_PSNR_DB, 10 * float(np.log10(255.0**2 / error)))
    _, map_ = structural_similarity(drawn, shown, win_size=SSIM_WINDOW, channel_axis=2, data_range=255, full=True)
    return FrontSimilarity(psnr, float(map_[both].mean()))


def shape_measures(mesh: TexturedMesh) -> dict[str, Any]:
    """Measures of the unsplit solid by trimesh, independently of `exporters.solid`.

    watertight : every edge has two triangles; winding_consistent : and they run along it in opposite directions;
    components : pieces connected over edges; genus : handles, None unless both of the former;
    volume_m3 : enclosed volume, positive if triangles are counter-clockwise from outside; triangles : their number
    """
    import trimesh

    solid = solid_of(mesh)
    body = trimesh.Trimesh(mesh.vertices[solid.first].astype(np.float64), solid.faces, process=False)
    pieces = trimesh.graph.connected_component_labels(body.face_adjacency, node_count=len(body.faces))
    components = int(pieces.max()) + 1 if len(pieces) else 0
    clean = bool(body.is_watertight and body.is_winding_consistent)
    return {
        "watertight": bool(body.is_watertight),
        "winding_consistent": bool(body.is_winding_consistent),
        "components": components,
        "genus": components - int(body.euler_number) // 2 if clean else None,
        "volume_m3": float(body.volume),
        "triangles": len(body.faces),
    }


def load_textured(path: Path | str) -> TexturedMesh:
    """Read a .glb, .gltf, .ply or .obj file with one mesh and perhaps its outline, by trimesh.

    Vertices at equal positions become one vertex of the solid; part labels, observed mask and levels of detail are
    not read. Raises ExportError where the file cannot be read or does not hold exactly one triangle mesh.
    """
    import trimesh

    if Path(path).suffix.lower() in (".ply", ".obj"):
        check_triangle_file(Path(path))
    try:
        scene = trimesh.load_scene(path, process=False)
        nodes = [scene.graph[name] for name in scene.graph.nodes_geometry]
        solids = [node for node in nodes if not outline_form({"extras": scene.geometry[node[1]].metadata})]
        mesh = _textured(scene, solids, Path(path))
        return mesh if len(solids) == len(nodes) else _with_outline(mesh, Path(path))
    except ExportError:
        raise
    except Exception as error:  # the parsers of trimesh raise exceptions of many kinds
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise ExportError(path, f"cannot be read ({reason})", "give a .glb, .gltf, .ply or .obj file") from None


def _textured(scene: Any, nodes: list[Any], path: Path) -> TexturedMesh:
    import trimesh

    if len(nodes) != 1 or not isinstance(scene.geometry[nodes[0][1]], trimesh.Trimesh):
        raise ExportError(path, f"{len(nodes)} meshes", "give a file with exactly one triangle mesh")
    asset_from_node, name = nodes[0]
    body = scene.geometry[name]
    with np.errstate(invalid="ignore"):  # numbers that are not finite are refused with the mesh
        vertices = (body.vertices @ asset_from_node[:3, :3].T + asset_from_node[:3, 3]).astype(np.float32)
    normals = body.vertex_normals @ np.linalg.inv(asset_from_node[:3, :3])
    faces = np.asarray(body.faces, np.int32)
    corner = np.arange(len(vertices))[:, None]
    _, solid_index = merged_by_position(vertices, corner)
    uv, texture, colors = None, None, None
    if isinstance(body.visual, trimesh.visual.TextureVisuals):
        if body.visual.uv is not None:
            # trimesh flips v on reading; here row 0 is v = 0, as in the file.
            uv = np.clip(body.visual.uv * (1, -1) + (0, 1), 0.0, 1.0).astype(np.float32)
        # glTF's material, and that of OBJ.
        image = getattr(body.visual.material, "baseColorTexture", None) or getattr(body.visual.material, "image", None)
        if image is not None and uv is not None:
            texture = Texture(np.asarray(image.convert("RGBA" if image.mode == "RGBA" else "RGB")))
        if "color" in body.visual.vertex_attributes:
            colors = _srgb(np.asarray(body.visual.vertex_attributes["color"])[:, :3])
    elif body.visual.kind == "vertex" and path.suffix.lower() in (".ply", ".obj"):
        colors = np.asarray(body.visual.vertex_colors[:, :3], np.uint8)
    return TexturedMesh(
        vertices=vertices,
        faces=faces,
        normals=unit_normals(normals.astype(np.float32)),
        solid_index=solid_index.reshape(-1),
        uv=uv,
        texture=texture,
        colors=colors,
    )


def _with_outline(mesh: TexturedMesh, path: Path) -> TexturedMesh:
    surface, _ = merged_by_position(mesh.vertices, mesh.faces)
    return replace(mesh, outline=read_outline(read_gltf(path), surface))


def _srgb(stored: NDArray[Any]) -> ByteArray:
    """sRGB bytes of glTF's vertex colours, which are linear: floats, or integers that mean the range [0, 1]."""
    whole = np.iinfo(stored.dtype).max if stored.dtype.kind == "u" else 1.0
    linear = np.clip(stored / whole, 0.0, 1.0)
    return np.asarray(np.rint(255 * srgb_from_linear(linear)), dtype=np.uint8)


def front_pixels(
    mesh: TexturedMesh,
    size: tuple[int, int],
    metres_per_pixel: float,
    origin_px: tuple[float, float],
    samples: int,
    mode: Any,
) -> ByteArray:
    """(H, W, 4) uint8, rendering of the front at the pixels of the drawing; size : (width, height)."""
    width, height = size
    x0, y0 = origin_px
    left, bottom, right, top = -x0, y0 - height, width - x0, y0
    bounds = tuple(metres_per_pixel * edge for edge in (left, bottom, right, top))
    return render_mesh(mesh, yaw_deg=0.0, size=size, mode=mode, bounds=bounds, samples=samples)  # type: ignore[arg-type]


def box_of(mask: BoolArray) -> tuple[tuple[int, int], tuple[int, int]]:
    """Bounding box of a mask: first and one-past-last (x, y)."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return (int(columns[0]), int(rows[0])), (int(columns[-1]) + 1, int(rows[-1]) + 1)


def every_step(image: NDArray[Any], edges: tuple[int, int, int, int], step: int) -> NDArray[Any]:
    """Every step-th pixel between the edges x0, y0, x1, y1, the first one step // 2 inside; zero outside the image."""
    x0, y0, x1, y1 = edges
    first_x, first_y = x0 + step // 2, y0 + step // 2
    # At least one pixel, even of regions thinner than a step.
    column, row = np.arange(first_x, max(x1, first_x + 1), step), np.arange(first_y, max(y1, first_y + 1), step)
    there_x, there_y = ((at >= 0) & (at < n) for at, n in ((column, image.shape[1]), (row, image.shape[0])))
    result = np.zeros((len(row), len(column), *image.shape[2:]), image.dtype)
    result[np.ix_(there_y, there_x)] = image[np.ix_(row[there_y], column[there_x])]
    return result


def coarse_point(point_px: tuple[float, float], start: tuple[int, int], step: int) -> tuple[float, float]:
    """Position of a point of the image in pixels of `every_step`, whose centres are those of the pixels taken."""
    shift = step // 2 + 0.5 - step / 2
    return (point_px[0] - start[0] - shift) / step, (point_px[1] - start[1] - shift) / step


def _soft_figure(mask: BoolArray, alpha: ByteArray) -> BoolArray:
    """The mask and the half-transparent pixels at its rim: the other half of an antialiased edge."""
    from scipy.ndimage import binary_dilation

    rim = binary_dilation(mask, np.ones((3, 3), np.bool_)) & (alpha < 255)
    return np.asarray(mask | rim)
