"""The road from a figure to a model, in the order of the paper.

Pure: no files, no clock, no terminal. `steps` lists the verbs; each takes the results of earlier ones by name, so that
a caller can time them, keep what they make and start in the middle.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from exporters.asset import Texture, TexturedMesh
from fig2mesh.asset_frame import asset_from_figure
from fig2mesh.counters import count
from fig2mesh.field.body import Body
from fig2mesh.image_frame import image_frame
from fig2mesh.mesh.bake import Baked, bake, drawn_faces
from fig2mesh.mesh.normals import vertex_normals
from fig2mesh.mesh.scan import scan
from fig2mesh.mesh.simplify import deviation, simplify
from fig2mesh.mesh.solid import Solid, make_solid
from fig2mesh.mesh.unwrap import Drawn, unwrap
from fig2mesh.parts.canvas import make_canvas
from fig2mesh.parts.network import part_inference
from fig2mesh.parts.outline import Outline, outline_parts
from fig2mesh.pose.network import lift_by_network
from fig2mesh.pose.order import ordered
from fig2mesh.pose.prior import lift
from fig2mesh.records import ByteArray, Figure, FloatArray, Mesh, PointCloud, Pose3D, Surface, UvMesh
from fig2mesh.settings import Settings
from fig2mesh.texture.sources import Sources, make_sources
from fig2mesh.texture.votes import Unseen

LEAST_TEXELS = 128


@dataclass(frozen=True)
class Step:
    """One verb of the pipeline.

    name : of the verb and of its result
    needs : names of the results it takes, in order
    run : the verb
    kept : whether its result is worth a file; the others are made anew in no time
    """

    name: str
    needs: tuple[str, ...]
    run: Callable[..., Any]
    kept: bool = True


def steps(settings: Settings, height_m: float, *, normals: bool = True) -> tuple[Step, ...]:
    """The verbs that a request needs, in order. The first takes the result "figure", the last makes "model".

    normals : whether the model has shading normals; textured ones always do
    """

    def lift_pose(figure: Figure) -> Pose3D:
        road = lift if settings.parts == "outline" else lift_by_network
        return ordered(road(figure, image_frame(figure)), figure.depth_order)

    def infer_parts(figure: Figure, pose: Pose3D) -> Outline:
        canvas = make_canvas(figure, image_frame(figure), settings.canvas_px, settings.voxel)
        infer = None
        if settings.parts != "outline":
            infer = part_inference(pose, settings.part_nodes, settings.device, settings.precision)
        return outline_parts(canvas, pose, figure.visible, voxel=settings.voxel, device=settings.device, infer=infer)

    def assemble(outline: Outline) -> Body:
        return Body(outline.parts, fillets=outline.fillets)

    def scan_body(body: Body) -> PointCloud:
        return scan(body, spacing=settings.spacing, seed=settings.seed)

    def mesh_cloud(cloud: PointCloud, body: Body, pieces: int) -> Solid:
        return make_solid(cloud, body, settings, pieces)

    def mesh_field(body: Body, pieces: int) -> Solid:
        return make_solid(None, body, settings, pieces)

    def simplify_levels(solid: Solid) -> tuple[Mesh, ...]:
        return tuple(simplify(solid.mesh, max(settings.triangles // 4**level, 200)) for level in range(settings.lods))

    def unwrap_levels(figure: Figure, levels: tuple[Mesh, ...]) -> tuple[UvMesh, ...]:
        frame = image_frame(figure)
        unwrapped = []
        for level, mesh in enumerate(levels):
            pixels = frame.image_from_figure(mesh.vertices[:, :2].astype(np.float64))
            drawn = Drawn(drawn_faces(mesh), pixels)
            unwrapped.append(unwrap(mesh, texture_size=_texels(settings, level), drawn=drawn))
        return tuple(unwrapped)

    def find_colours(figure: Figure, pose: Pose3D, outline: Outline, body: Body) -> Sources:
        frame = image_frame(figure)

        def ask(picture: FloatArray) -> Unseen:
            from fig2mesh.texture.unseen import shipped, unseen_sides

            return unseen_sides(body, pose, picture, frame, shipped())

        inferred = settings.textures == "network"
        return make_sources(
            figure,
            frame,
            outline,
            settings.texture_size,
            settings.seed,
            ask if inferred else None,
            contours=settings.contours == "keep",
        )

    def bake_levels(figure: Figure, sources: Sources, body: Body, unwrapped: tuple[UvMesh, ...]) -> tuple[Baked, ...]:
        frame = image_frame(figure)
        return tuple(
            bake(
                mesh,
                vertex_normals(mesh.solid, body),
                _face_parts(mesh.solid, body),
                sources,
                frame,
                _texels(settings, level),
                body,
            )
            for level, mesh in enumerate(unwrapped)
        )

    def know_surface(body: Body, solid: Solid, levels: tuple[Mesh, ...]) -> tuple[Surface, ...]:
        return tuple(
            Surface(
                normals=_shading_normals(mesh, body) if normals else None,
                parts=_labels(body, mesh.vertices),
                deviation=deviation(mesh, solid.mesh),
            )
            for mesh in levels
        )

    def finish(
        pose: Pose3D, surfaces: tuple[Surface, ...], unwrapped: tuple[UvMesh, ...], baked: tuple[Baked, ...]
    ) -> tuple[TexturedMesh, ...]:
        levels = finish_bare(pose, surfaces, tuple(mesh.solid for mesh in unwrapped))
        return tuple(
            replace(
                level,
                vertices=level.vertices[mesh.solid_index],
                faces=mesh.faces,
                normals=None if level.normals is None else level.normals[mesh.solid_index],
                solid_index=mesh.solid_index,
                uv=mesh.uv,
                texture=Texture(texture.color),
                observed=Texture(texture.observed[..., None]),
                parts=None if level.parts is None else level.parts[mesh.solid_index],
            )
            for level, mesh, texture in zip(levels, unwrapped, baked, strict=True)
        )

    def finish_bare(pose: Pose3D, surfaces: tuple[Surface, ...], meshes: tuple[Mesh, ...]) -> tuple[TexturedMesh, ...]:
        asset = asset_from_figure(pose, meshes[0].vertices, height_m)
        scale = float(asset.matrix[0, 0])
        return tuple(
            TexturedMesh(
                vertices=asset.apply(mesh.vertices).astype(np.float32),
                faces=mesh.faces,
                normals=surface.normals,
                solid_index=np.arange(len(mesh.vertices), dtype=np.int32),
                parts=surface.parts,
                deviation_m=(surface.deviation[0] * scale, surface.deviation[1] * scale),
            )
            for mesh, surface in zip(meshes, surfaces, strict=True)
        )

    meshing = (
        (Step("cloud", ("body",), scan_body), Step("solid", ("cloud", "body", "pieces"), mesh_cloud))
        if settings.mesher == "ball-pivot"
        else (Step("solid", ("body", "pieces"), mesh_field),)
    )
    colouring = (
        (Step("model", ("lift", "surface", "simplify"), finish_bare, kept=False),)
        if settings.textures == "none"
        else (
            Step("unwrap", ("figure", "simplify"), unwrap_levels),
            Step("textures", ("figure", "lift", "parts", "body"), find_colours, kept=False),
            Step("bake", ("figure", "textures", "body", "unwrap"), bake_levels),
            Step("model", ("lift", "surface", "unwrap", "bake"), finish, kept=False),
        )
    )
    return (
        Step("lift", ("figure",), lift_pose),
        Step("parts", ("figure", "lift"), infer_parts),
        Step("body", ("parts",), assemble, kept=False),
        *meshing,
        Step("simplify", ("solid",), simplify_levels),
        Step("surface", ("body", "solid", "simplify"), know_surface),
        *colouring,
    )


def _shading_normals(mesh: Mesh, body: Body) -> FloatArray:
    count("shading normals", len(mesh.vertices))
    return vertex_normals(mesh, body)


def make_only(
    goal: str, road: Sequence[Step], results: dict[str, Any], advance: Callable[[str], object] = lambda name: None
) -> None:
    """Run of `road` what the result `goal` needs and `results` lacks, in its order; `results` gets what is made.

    advance : told the name of each step before it runs
    """
    wanted = {goal}
    chosen = []
    for step in reversed(road):
        if step.name in wanted - results.keys():
            chosen.append(step)
            wanted |= set(step.needs)
    for step in reversed(chosen):
        advance(step.name)
        results[step.name] = step.run(*(results[name] for name in step.needs))


def _texels(settings: Settings, level: int) -> int:
    """Texels a side: half as many with each level, but enough to have charts."""
    return max(settings.texture_size >> level, min(settings.texture_size, LEAST_TEXELS))


def _labels(body: Body, points: np.ndarray) -> ByteArray:
    """(N,) uint8 part label nearest to each point."""
    return body.labels[body.nearest_part(points)]


def _face_parts(mesh: Mesh, body: Body) -> ByteArray:
    return _labels(body, mesh.vertices[mesh.faces].mean(axis=1).astype(np.float32))
