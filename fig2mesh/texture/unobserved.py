"""Inference of the locations in the drawing from which the sides not drawn take their colours (paper §4.3 and §4.4).

Four sides of the body are traced, their texture coordinates inferred, and in texture space a network infers for every
texel the displacement of its colour from the location straight behind the drawing. Two more networks add details to the
sides painted so, one of them to heads.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.counters import count
from fig2mesh.image_frame import ImageFrame
from fig2mesh.nets.head_hsv import HeadHsv, enhance
from fig2mesh.nets.texture_fill import TextureFill, fill_inputs, sample
from fig2mesh.nets.uv_unet import UvUnet, infer_uv
from fig2mesh.nets.view_refine import ViewRefine, refine
from fig2mesh.skeleton import PART
from fig2mesh.texture.sides import SideViews
from fig2mesh.texture.space import inwards, shown_alike, spread, trust

SMOOTH_PX: Final = 2.5
"""Standard deviation of the average over changes, pixels."""


def front_picture(picture: NDArray[np.float32], frame: ImageFrame, sides: SideViews) -> NDArray[np.float32]:
    """(H, W, 3) the drawing, colours 0-255, resampled to the front view of `sides`."""
    size = sides.labels.shape[1]
    along = (np.arange(size) + 0.5 - size / 2) * sides.pitch
    x, y = np.meshgrid(sides.centre[0] + along, sides.centre[1] - along)
    pixels = frame.image_from_figure(np.stack([x, y], axis=-1))
    # Pixels of the side are larger than the drawing's: average before sampling.
    blur = 0.4 * max(sides.pitch / frame.units_per_px - 1.0, 0.0)
    soft = ndimage.gaussian_filter(picture, (blur, blur, 0)) if blur else picture
    where = np.moveaxis(pixels[..., ::-1] - 0.5, -1, 0)
    channels = [ndimage.map_coordinates(soft[..., c], where, order=1, mode="nearest") for c in range(3)]
    return np.stack(channels, axis=-1).astype(np.float32)


@dataclass(frozen=True)
class TextureNets:
    """Texture networks in the order of their use; the main command uses the first two only."""

    uv: UvUnet
    fill: TextureFill
    refine: ViewRefine | None = None
    head: HeadHsv | None = None


def shipped() -> TextureNets:
    """Read the networks that come with the package."""
    from fig2mesh.nets.texture_fill import FILL_WEIGHTS, FillShape
    from fig2mesh.nets.uv_unet import SHIPPED, UV_WEIGHTS

    return TextureNets(UV_WEIGHTS.shipped(SHIPPED), FILL_WEIGHTS.shipped(FillShape()))


def texture_coordinates(sides: SideViews, net: UvUnet) -> NDArray[np.float32]:
    """(4, H, W, 2) texture coordinates of the sides."""
    count("texture coordinate network")
    found = infer_uv(net, torch.from_numpy(sides.depth), torch.from_numpy(sides.labels))
    return np.asarray(found.movedim(1, 3).numpy())


def place_changes(
    sides: SideViews, front: NDArray[np.float32], uv: NDArray[np.float32], net: TextureFill
) -> NDArray[np.float32]:
    """(4, H, W, 2) displacement of the sides' colours from straight behind the drawing, edges at -1 and 1, y down.

    front : as `front_picture` gives it; uv : (4, H, W, 2)
    """
    visible = sides.labels > 0
    places = sides.places()
    same = shown_alike(sides.labels, places)
    is_front = np.zeros(visible.shape, bool)
    is_front[0] = True
    values = np.concatenate([places, is_front[..., None], same[..., None]], axis=-1)
    weight = trust(inwards(visible))
    texels, total = spread(uv[visible], values[visible], weight[visible], net.shape.size)
    there = torch.from_numpy(total > 0)[None]
    place = torch.from_numpy(texels[..., :2]).movedim(2, 0)[None]
    colour = sample(torch.from_numpy(np.clip(front / 255, 0, 1)).movedim(2, 0)[None], place)
    flags = torch.from_numpy(texels[..., 2:])[None]
    count("texture completion network")
    with torch.no_grad():
        change = net(fill_inputs(place, there, flags[..., 0] > 0, flags[..., 1] > 0.5, colour))
    at = torch.from_numpy(2 * uv - 1).movedim(3, 1)
    found = sample(change.expand(len(at), -1, -1, -1), at).movedim(1, 3).numpy()
    return _smoothed(np.where(visible[..., None], found, np.float32(0)), visible)


def _smoothed(change: NDArray[np.float32], visible: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Average changes (4, H, W, 2) over some pixels of the body: texture coordinates err from pixel to pixel."""
    result = np.zeros_like(change)
    for side in range(len(change)):
        share = ndimage.gaussian_filter(visible[side].astype(np.float32), SMOOTH_PX)
        for axis in range(2):
            blurred = ndimage.gaussian_filter(change[side, ..., axis], SMOOTH_PX)
            result[side, ..., axis] = np.where(visible[side], blurred / np.maximum(share, 1e-6), 0.0)
    return result


def paint(sides: SideViews, front: NDArray[np.float32], nets: TextureNets) -> NDArray[np.float32]:
    """(4, H, W, 3) pictures of the sides, 0-255; the front is the drawing where that shows it.

    front : as `front_picture` gives it
    """
    uv = texture_coordinates(sides, nets.uv)
    place = torch.from_numpy(sides.places() + place_changes(sides, front, uv, nets.fill)).movedim(3, 1)
    picture = torch.from_numpy(np.clip(front / 255, 0, 1)).movedim(2, 0)[None].expand(4, -1, -1, -1)
    painted = sample(picture, place)
    coordinates = torch.from_numpy(uv).movedim(3, 1)
    labels = torch.from_numpy(sides.labels)
    if nets.refine is not None:
        made = refine(nets.refine, painted[1:], coordinates[1:], torch.from_numpy(sides.depth[1:]), labels[1:])
        if nets.head is not None:
            heads = enhance(nets.head, painted[1:], coordinates[1:], labels[1:] == PART["head"])
            made = torch.where((labels[1:] == PART["head"])[:, None], heads, made)
        painted = torch.cat([painted[:1], made])
    return np.asarray(255 * painted.movedim(1, 3).numpy(), np.float32)
