"""Stage `cloud`: the body's surface as uniform oriented points, by sphere tracing (paper §4.5)."""

from __future__ import annotations

from fig2mesh.field.body import Body
from fig2mesh.mesh.scan import scan
from fig2mesh.records import PointCloud


def cloud(body: Body, *, spacing: float, seed: int) -> PointCloud:
    """Points of the surface, FIGURE, neighbours about `spacing` apart."""
    return scan(body, spacing=spacing, seed=seed)
