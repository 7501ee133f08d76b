"""Triangle rasterisation in texture space, compiled."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fig2mesh.field.compiled import kernel


@kernel
def rasterise_triangles(
    corners: NDArray[np.float64],
    faces: NDArray[np.int32],
    owner: NDArray[np.int32],
    weights: NDArray[np.float32],
) -> None:
    """Fill `owner` and `weights` (see `fig2mesh.mesh.bake.rasterise`); corners are in texels."""
    size = owner.shape[0]
    for f in range(faces.shape[0]):
        ax, ay = corners[faces[f, 0], 0], corners[faces[f, 0], 1]
        bx, by = corners[faces[f, 1], 0], corners[faces[f, 1], 1]
        cx, cy = corners[faces[f, 2], 0], corners[faces[f, 2], 1]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if area == 0.0:
            continue
        x0 = max(int(np.floor(min(ax, bx, cx) - 0.5)), 0)
        x1 = min(int(np.ceil(max(ax, bx, cx) - 0.5)), size - 1)
        y0 = max(int(np.floor(min(ay, by, cy) - 0.5)), 0)
        y1 = min(int(np.ceil(max(ay, by, cy) - 0.5)), size - 1)
        for y in range(y0, y1 + 1):
            py = y + 0.5
            for x in range(x0, x1 + 1):
                px = x + 0.5
                wa = ((bx - px) * (cy - py) - (by - py) * (cx - px)) / area
                wb = ((cx - px) * (ay - py) - (cy - py) * (ax - px)) / area
                wc = 1.0 - wa - wb
                if wa >= -1e-9 and wb >= -1e-9 and wc >= -1e-9:
                    owner[y, x] = f
                    weights[y, x, 0] = wa
                    weights[y, x, 1] = wb
                    weights[y, x, 2] = wc
