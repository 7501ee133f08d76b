"""The layers of a drawing in depth: completed outlines, inflated around a middle surface that follows the joints."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.parts.canvas import Canvas
from fig2mesh.parts.depth import mid_surface, place_limb
from fig2mesh.parts.inflate import inflate
from fig2mesh.parts.joining import floating
from fig2mesh.parts.limbs import Limb
from fig2mesh.parts.profile import Profile, column_extents, measure_profile
from fig2mesh.parts.split import Layer, Split
from fig2mesh.records import JOINT, PART, PART_NAMES, PartSdf

LOAD = {"torso": 0.95, "head": 3.0, "garment": 1.1, "foot": 2.2, "limb": 2.0}
"""Right-hand side of the inflation by kind of part: 2 makes a strip as deep as wide, 1 about 0.7 times; a torso is
two thirds as deep as wide, a head nearly a ball."""

FRONTAL_FOOT = 4.0
"""What a foot that points to the viewer has on top of that: it is longer than the drawing shows it wide."""


ATTEMPTS = 6
"""Each brings floating limbs half way back to the middle of the body; the last one all the way."""

REACH_IN = 0.012
"""How much further a limb that floats reaches into its neighbours with each attempt, FIGURE units."""


@dataclass(frozen=True)
class LayerSurface:
    """A layer in depth: it fills z0 − √u … z0 + √u.

    u : (H, W) float64, squared half thickness in FIGURE units², negative outside the outline
    z0 : (H, W) float64, FIGURE z of its middle
    labels : (H, W) uint8, part of each pixel, 0 outside the region
    """

    u: NDArray[np.float64]
    z0: NDArray[np.float64]
    labels: NDArray[np.uint8]


def raise_layers(
    canvas: Canvas,
    divided: Split,
    joints: NDArray[np.float64],
    device: str,
    fields: tuple[PartSdf, ...] = (),
) -> tuple[LayerSurface, ...]:
    """The layers of a split figure in depth, the core first.

    Parameters
    ----------
    joints : (21, 3) float64, FIGURE
    device : PyTorch device of the inflation
    fields : what networks made of the parts; the layers take their thickness and their place before or behind the
        bones from them, and keep the drawn outline
    """
    loads = part_loads(joints)
    core, *others = divided.layers
    points, depth = _trunk(divided, joints)
    profiles = {
        layer.name: _layer_profile(canvas, layer, *bones, loads, device, fields)
        for layer, bones in [(core, (points, depth)), *((x, (x.limb.points, x.limb.depth)) for x in others if x.limb)]
    }
    layers: list[Layer] = [core]
    limbs: list[Limb | None] = [None]
    surfaces = [inflated(canvas, core, mid_surface(canvas, points, depth), loads, device, profiles)]
    top, bottom = _extent(surfaces[0])
    legs_top, legs_bottom = np.full_like(top, np.nan), np.full_like(bottom, np.nan)
    for layer in sorted(others, key=_drawn_order):
        assert layer.limb is not None
        if layer.limb.is_arm:
            limb = place_limb(layer.limb, canvas, np.fmax(top, legs_top), np.fmin(bottom, legs_bottom), behind=True)
        else:
            raised = layer.limb.seen & (joints[JOINT["pelvis"], 1] < layer.limb.points[:, 1])
            limb = place_limb(layer.limb, canvas, legs_top, legs_bottom)
            if raised.any():
                limb = place_limb(limb, canvas, top, bottom)
        surface = inflated(canvas, layer, mid_surface(canvas, limb.points, limb.depth), loads, device, profiles)
        layers.append(layer)
        limbs.append(limb)
        surfaces.append(surface)
        above, below = _extent(surface)
        if not limb.is_arm:
            legs_top, legs_bottom = np.fmax(legs_top, above), np.fmin(legs_bottom, below)
    return _joined(canvas, layers, limbs, surfaces, loads, device, profiles)


def _trunk(divided: Split, joints: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(N, 2) points and (N,) depths of the bones in the core: the trunk, the head and the limbs that lie free of it."""
    in_core = [limb for limb in divided.limbs if all(limb is not layer.limb for layer in divided.layers)]
    trunk_joints = [
        JOINT[n] for n in ("neck", "thorax", "pelvis", "l_shoulder", "r_shoulder", "l_hip", "r_hip", "head")
    ]
    trunk = np.concatenate([joints[trunk_joints], _between(joints[JOINT["thorax"]], joints[JOINT["pelvis"]])])
    points = np.concatenate([trunk[:, :2], *(limb.points for limb in in_core)])
    return points, np.concatenate([trunk[:, 2], *(limb.depth for limb in in_core)])


def _layer_profile(
    canvas: Canvas,
    layer: Layer,
    points: NDArray[np.float64],
    depth: NDArray[np.float64],
    loads: NDArray[np.float64],
    device: str,
    fields: tuple[PartSdf, ...],
) -> Profile | None:
    """What the networks say of a layer; None where they know none of its parts."""
    own = [field for field in fields if (layer.labels == field.part).any()]
    if not own:
        return None
    front, back = column_extents(canvas, own)
    # Where the layer goes on without a network (cloth, hair), so does what is inflated for comparison: inflation sinks
    # towards an end, and a network's part that is cut off there does not.
    unknown = layer.region & ~np.isin(layer.labels, [field.part for field in own])
    covered = np.isfinite(front) | unknown
    _, nearest = ndimage.distance_transform_edt(~layer.region, return_indices=True)
    whole = replace(layer, region=covered, labels=layer.labels[tuple(nearest)])
    reference = inflate(covered, _load(canvas, whole, loads), device) * canvas.pitch**2
    bone = mid_surface(canvas, points, depth)
    return measure_profile(canvas, layer.region, front, back, reference, bone)


def _joined(
    canvas: Canvas,
    layers: list[Layer],
    limbs: list[Limb | None],
    surfaces: list[LayerSurface],
    loads: NDArray[np.float64],
    device: str,
    profiles: dict[str, Profile | None],
) -> tuple[LayerSurface, ...]:
    """The surfaces with floating limbs brought back towards the middle of the body until they hold."""
    for attempt in range(ATTEMPTS):
        half = [np.sqrt(np.maximum(surface.u, 0.0)) for surface in surfaces]
        loose = floating(half, [surface.z0 for surface in surfaces], canvas.inside)
        if not loose:
            break
        for index in sorted(loose):
            limb = limbs[index]
            assert limb is not None
            limbs[index] = limb = replace(limb, depth=(0.5 if attempt < ATTEMPTS - 1 else 0.0) * limb.depth)
            if attempt:
                # Being at the same depth is not enough for layers that only meet at their rims.
                layers[index] = _grown(canvas, layers[index])
            z0 = mid_surface(canvas, limb.points, limb.depth)
            surfaces[index] = inflated(canvas, layers[index], z0, loads, device, profiles)
    return tuple(surfaces)


def _grown(canvas: Canvas, layer: Layer) -> Layer:
    """The layer reaching further into its neighbours, within the silhouette."""
    distance, nearest = ndimage.distance_transform_edt(~layer.region, sampling=canvas.pitch, return_indices=True)
    region = (distance < REACH_IN) & canvas.inside
    return replace(layer, region=region, labels=np.where(region, layer.labels[tuple(nearest)], np.uint8(0)))


def _drawn_order(layer: Layer) -> tuple[bool, float, float]:
    """Legs before arms; of two legs first the one that the drawing hides, else the one further up (further away)."""
    limb: Limb | None = layer.limb
    assert limb is not None
    return limb.is_arm, float(limb.seen.mean()), -float(limb.points[-1, 1])


def _between(start: NDArray[np.float64], end: NDArray[np.float64]) -> NDArray[np.float64]:
    t = np.linspace(0.0, 1.0, 6)[:, None]
    return start + t * (end - start)


def _extent(surface: LayerSurface) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    half = np.where(surface.u > 0, np.sqrt(np.maximum(surface.u, 0.0)), np.nan)
    return surface.z0 + half, surface.z0 - half


def part_loads(joints: NDArray[np.float64]) -> NDArray[np.float64]:
    """Right-hand side of the inflation for every part label."""
    loads = np.array([LOAD.get(name, LOAD["limb"]) for name in PART_NAMES])
    for side in "lr":
        across, along = np.abs(joints[JOINT[f"{side}_foot"], :2] - joints[JOINT[f"{side}_ankle"], :2])
        sideways = across / max(0.8 * float(np.hypot(across, along)), 1e-9)
        loads[PART[f"{side}_foot"]] = LOAD["foot"] + FRONTAL_FOOT * max(0.0, 1.0 - float(sideways))
    return loads


def inflated(
    canvas: Canvas,
    layer: Layer,
    z0: NDArray[np.float64],
    loads: NDArray[np.float64],
    device: str,
    profiles: dict[str, Profile | None],
) -> LayerSurface:
    u = inflate(layer.region, _load(canvas, layer, loads), device) * canvas.pitch**2
    u = _extended(canvas, layer.region, u)
    profile = profiles.get(layer.name)
    if profile is not None:
        u, z0 = u * profile.ratio, z0 + profile.offset
    return LayerSurface(u, z0, layer.labels)


def _load(canvas: Canvas, layer: Layer, loads: NDArray[np.float64]) -> NDArray[np.float64]:
    """(H, W) right-hand side of the inflation, without jumps between parts."""
    values = np.where(layer.region, loads[layer.labels], 0.0)
    blur = 0.03 / canvas.pitch
    cover = ndimage.gaussian_filter(layer.region.astype(float), blur)
    return np.asarray(ndimage.gaussian_filter(values, blur) / np.maximum(cover, 1e-6))


def _extended(canvas: Canvas, region: NDArray[np.bool_], u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Continue u below zero outside its region, with the drawn contour located to a fraction of a pixel.

    Near the rim u grows linearly with the distance to it. The solver knows that distance only in whole pixels, the
    canvas knows it exactly: u is rescaled by their ratio. Outside, a circle's u goes on as −(s d + d²), where s is the
    slope at the rim: then the distance formula of `_evaluate` is exact for circular cross-sections.
    """
    whole = ndimage.distance_transform_edt(region, sampling=canvas.pitch)
    beyond, rim = ndimage.distance_transform_edt(~region, sampling=canvas.pitch, return_indices=True)
    slope = np.where(region, u / np.maximum(whole, canvas.pitch), 0.0)
    # The outermost pixels carry the solver's stairs; the slope two pixels further in is smooth.
    inner = whole >= 2.0 * canvas.pitch
    if inner.any():
        _, source = ndimage.distance_transform_edt(~inner, return_indices=True)
        slope = np.where(inner, slope, slope[tuple(source)])
    slope = slope[tuple(rim)]
    slope = np.where(region, slope, ndimage.gaussian_filter(slope, 1.5))
    # Where the region ends inside the silhouette (under another layer) its own raster distance must do.
    own = np.where(region, 0.5 * canvas.pitch - whole, beyond - 0.5 * canvas.pitch)
    distance = np.where(np.abs(own - canvas.sdf) < 1.5 * canvas.pitch, canvas.sdf, own)
    return np.asarray(np.where(distance > 0, -(slope * distance + distance**2), -slope * distance))
