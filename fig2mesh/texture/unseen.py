"""Where in the drawing the sides that it does not show take their colours from (paper §4.3 and §4.4).

Four sides of the body are traced, their texture coordinates inferred, and in texture space a network tells for every
texel how far from the place straight behind the drawing its colour is found. Colours themselves are not made up here,
so that all of them are the drawing's own and as sharp.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.nets.texture_fill import TextureFill, fill_inputs, sample
from fig2mesh.nets.uv_unet import UvUnet, infer_uv
from fig2mesh.parse.frame import ImageFrame
from fig2mesh.texture.changes import Changes
from fig2mesh.texture.sides import Sides
from fig2mesh.texture.space import spread

INNER_PX: Final = 5.0
"""Pixels this far inside of a side's silhouette count in full."""

LEAST_PX: Final = 1.5
"""Pixels nearer to the silhouette are seen at too much of a slant to tell anything."""


def front_picture(picture: NDArray[np.float32], frame: ImageFrame, sides: Sides) -> NDArray[np.float32]:
    """(H, W, 3) the drawing, colours 0-255, as the front of `sides` frames it."""
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


def unseen_changes(sides: Sides, front: NDArray[np.float32], uv_net: UvUnet, fill_net: TextureFill) -> Changes:
    """What the networks tell of a body.

    front : as `front_picture` gives it
    """
    with torch.no_grad():
        uv = infer_uv(uv_net, torch.from_numpy(sides.depth), torch.from_numpy(sides.labels)).movedim(1, 3).numpy()
    seen = sides.labels > 0
    inner = np.stack([ndimage.distance_transform_edt(np.pad(side, 1))[1:-1, 1:-1] for side in seen])
    places = sides.places()
    size = sides.labels.shape[1]
    pixel = np.clip(((places + 1) / 2 * size).astype(int), 0, size - 1)
    same = sides.labels[0][pixel[..., 1], pixel[..., 0]] == sides.labels
    is_front = np.zeros(seen.shape, bool)
    is_front[0] = True
    values = np.concatenate([places, is_front[..., None], same[..., None]], axis=-1)
    weight = np.clip(inner / INNER_PX, 0.05, 1.0)
    texels, total = spread(uv[seen], values[seen], weight[seen], fill_net.shape.size)
    there = torch.from_numpy(total > 0)[None]
    place = torch.from_numpy(texels[..., :2]).movedim(2, 0)[None]
    colour = sample(torch.from_numpy(np.clip(front / 255, 0, 1)).movedim(2, 0)[None], place)
    flags = torch.from_numpy(texels[..., 2:])[None]
    with torch.no_grad():
        change = fill_net(fill_inputs(place, there, flags[..., 0] > 0, flags[..., 1] > 0.5, colour))
    used = seen & (inner > LEAST_PX)
    at = torch.from_numpy(uv[used] * 2 - 1).T[None, :, :, None]
    found = sample(change, at)[0, :, :, 0].T.numpy()
    half = sides.pitch * size / 2
    return Changes(sides.points[used], (found * half * [1.0, -1.0]).astype(np.float32))
