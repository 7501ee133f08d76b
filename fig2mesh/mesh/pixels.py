"""Pixels of rendered pictures as bytes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fig2mesh.records import ByteArray


def straight_bytes(picture: NDArray[Any], background: tuple[int, int, int] | None) -> ByteArray:
    """(H, W, 4) uint8 sRGB and straight alpha of premultiplied colours 0-255 and coverage 0-1, (H, W, 4) floats.

    background : sRGB behind everything; None: transparent
    """
    cover = picture[..., 3:]
    if background is not None:
        colour = picture[..., :3] + (1 - cover) * np.array(background, picture.dtype)
        cover = np.ones_like(cover)
    else:
        colour = picture[..., :3] / np.maximum(cover, 1e-9)
    return np.asarray(np.rint(np.concatenate([np.clip(colour, 0, 255), 255 * cover], axis=2)), np.uint8)
