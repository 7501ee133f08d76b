"""Stage `body`: the part fields together as one field (paper §4.3)."""

from __future__ import annotations

from fig2mesh.field.body import Body
from fig2mesh.parts.outline import Outline


def body(parts: Outline) -> Body:
    """The union of the parts, FIGURE."""
    return Body(parts.parts, fillets=parts.fillets)
