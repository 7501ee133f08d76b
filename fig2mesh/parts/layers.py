"""Layers of a drawing in depth: completed outlines, inflated around a middle surface that follows the joints."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.parts.bones import Bones, core_bones, out_of_cloth
from fig2mesh.parts.canvas import Canvas
from fig2mesh.parts.depth import place_limb
from fig2mesh.parts.heads.frame import head_frame
from fig2mesh.parts.joining import floating
from fig2mesh.parts.layer_inflation import LayerInflation, LayerSurface
from fig2mesh.parts.limbs import Limb
from fig2mesh.parts.loads import part_loads
from fig2mesh.parts.props import prop_depth
from fig2mesh.parts.split import Layer, Split
from fig2mesh.records import PartSdf
from fig2mesh.skeleton import JOINT, PART

STANDING_FOOT_UNITS = 0.12
"""Largest height of a standing foot's tip above the lowest point of the figure, FIGURE units."""

_FLAT = Bones(np.zeros((1, 2)), np.zeros(1), np.zeros(1))

ATTEMPTS = 6
"""Number of attempts to join floating limbs: each moves them half way back to the middle of the body, the last one all
the way."""

REACH_STEP = 0.012
"""Growth of a floating limb into its neighbours with each attempt, FIGURE units."""


def raise_layers(
    canvas: Canvas,
    divided: Split,
    joints: NDArray[np.float64],
    device: str,
    fields: tuple[PartSdf, ...] = (),
) -> tuple[LayerSurface, ...]:
    """Layers of a split figure in depth, the core first.

    Parameters
    ----------
    joints : (21, 3) float64, FIGURE
    device : PyTorch device of the inflation
    fields : parts made by networks; the layers take their thickness and their offset from the bones from them, and keep
        the drawn outline
    """
    loads = part_loads(joints)
    core, *others = divided.layers
    props = [layer for layer in others if layer.limb is None]
    bones = core_bones(canvas, divided, joints)
    flat = _may_end_flat(canvas, divided, joints)
    make = LayerInflation(canvas, loads, flat, device, fields, head_frame(canvas, joints))
    surfaces = [make(core, bones)]
    layers: list[Layer] = [core]
    limbs: list[Limb | None] = [None]
    top, bottom = _extent(surfaces[0])
    legs_top, legs_bottom = np.full_like(top, np.nan), np.full_like(bottom, np.nan)
    for layer in sorted((layer for layer in others if layer.limb is not None), key=_drawn_order):
        assert layer.limb is not None
        if layer.limb.is_arm:
            limb = place_limb(layer.limb, canvas, np.fmax(top, legs_top), np.fmin(bottom, legs_bottom), behind=True)
        elif layer.limb.cloth:
            limb = place_limb(out_of_cloth(layer.limb, canvas, divided, joints), canvas, legs_top, legs_bottom)
        else:
            raised = layer.limb.seen & (joints[JOINT["pelvis"], 1] < layer.limb.points[:, 1])
            limb = place_limb(layer.limb, canvas, legs_top, legs_bottom)
            if raised.any():
                limb = place_limb(limb, canvas, top, bottom)
        surface = make(layer, Bones.of(limb))
        if limb.cloth:
            surface = _within(surface, canvas.pitch, top, bottom)
        layers.append(layer)
        limbs.append(limb)
        surfaces.append(surface)
        above, below = _extent(surface)
        if not limb.is_arm:
            legs_top, legs_bottom = np.fmax(legs_top, above), np.fmin(legs_bottom, below)
    for layer in props:
        surface = make(layer, _FLAT)
        half = np.sqrt(np.maximum(surface.u, 0.0))
        depth = prop_depth(half, layer.shown, [_extent(other) for other in surfaces])
        layers.append(layer)
        limbs.append(None)
        surfaces.append(replace(surface, z0=surface.z0 + depth))
    return _joined(canvas, layers, limbs, surfaces, make)


def _may_end_flat(canvas: Canvas, divided: Split, joints: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Labels of pixels that may end flat: garments that legs come out of or that hide them, feet on the ground."""
    ground = canvas.points()[canvas.inside][:, 1].min()
    highest = ground + STANDING_FOOT_UNITS
    standing = [
        PART[f"{side}_foot"]
        for side in "lr"
        if joints[JOINT[f"{side}_foot"], 1] < highest and joints[JOINT[f"{side}_ankle"], 1] > ground
    ]
    legs = [limb for limb in divided.limbs if not limb.is_arm]
    hems = [PART["garment"]] if not legs or any(limb.cloth for limb in legs) else []
    return np.array([*hems, *standing], np.uint8)


def _joined(
    canvas: Canvas,
    layers: list[Layer],
    limbs: list[Limb | None],
    surfaces: list[LayerSurface],
    make: LayerInflation,
) -> tuple[LayerSurface, ...]:
    """Move floating limbs back towards the middle of the body until they are joined."""
    for attempt in range(ATTEMPTS):
        loose = _floating(canvas, surfaces)
        if not loose:
            break
        for index in sorted(loose):
            share = 0.5 if attempt < ATTEMPTS - 1 else 0.0
            if attempt:
                # Being at the same depth is not enough for layers that only meet at their rims.
                layers[index] = _grown(canvas, layers[index])
            limb = limbs[index]
            if limb is None:
                depth = share * surfaces[index].z0
                surfaces[index] = replace(make(layers[index], _FLAT), z0=depth)
                continue
            limbs[index] = limb = replace(limb, depth=share * limb.depth)
            surfaces[index] = make(layers[index], Bones.of(limb))
    else:
        if _floating(canvas, surfaces):
            # Joints that are nowhere near a body bend the core itself out of the plane of the drawing.
            surfaces = [replace(surface, z0=np.zeros_like(surface.z0)) for surface in surfaces]
    return tuple(surfaces)


def _floating(canvas: Canvas, surfaces: list[LayerSurface]) -> set[int]:
    half = [np.sqrt(np.maximum(surface.u, 0.0)) for surface in surfaces]
    return floating(half, [surface.z0 for surface in surfaces], canvas.inside)


def _grown(canvas: Canvas, layer: Layer) -> Layer:
    """Grow a layer into its neighbours, within the silhouette."""
    distance, nearest = ndimage.distance_transform_edt(~layer.region, sampling=canvas.pitch, return_indices=True)
    region = (distance < REACH_STEP) & canvas.inside
    return replace(layer, region=region, labels=np.where(region, layer.labels[tuple(nearest)], np.uint8(0)))


def _drawn_order(layer: Layer) -> tuple[bool, float, float]:
    """Sort key of layers: legs before arms; of two legs first a hidden one, else the higher (farther) one."""
    limb: Limb | None = layer.limb
    assert limb is not None
    return limb.is_arm, float(limb.seen.mean()), -float(limb.points[-1, 1])


def _within(surface: LayerSurface, pitch: float, top: NDArray[np.float64], bottom: NDArray[np.float64]) -> LayerSurface:
    """Keep a leg inside the cloth that it comes out of, a little below its surface."""
    front, back = _extent(surface)
    lower, upper = np.fmin(front, top - pitch), np.fmax(back, bottom + pitch)
    there = np.isfinite(top) & np.isfinite(front)
    half = np.where(there, np.maximum(lower - upper, 0.5 * pitch) / 2, 0.0)
    return replace(
        surface,
        u=np.where(there, half**2, surface.u),
        z0=np.where(there, (np.clip(lower, bottom, top) + np.clip(upper, bottom, top)) / 2, surface.z0),
    )


def _extent(surface: LayerSurface) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    # Beyond a flat end the layer is cut off.
    there = (surface.u > 0) & (True if surface.clip is None else surface.clip < 0)
    half = np.where(there, np.sqrt(np.maximum(surface.u, 0.0)), np.nan)
    return surface.z0 + half, surface.z0 - half
