"""Request of `fig2mesh annotate`."""

from __future__ import annotations

from pathlib import Path

from fig2mesh.conversion.fields import option, request_class
from fig2mesh.conversion.request import FigureFiles
from fig2mesh.settings import Parts


@request_class
class AnnotateRequest(FigureFiles):
    """A figure whose joints and parts are corrected by hand, and where they are saved."""

    output: Path | None = option(
        default=None,
        short="o",
        metavar="DIR",
        help="Folder of keypoints.json, mask.png and part_labels.png; those in it are gone on with, and saved over. "
        "Default: FIGURE's stem + _annotation in the current folder.",
    )
    parts: Parts = option(default="network", help="How the preview is made; as in the main job.")
    port: int = option(
        default=0, low=0, high=65535, metavar="N", default_text="a free one", help="Of the page's server."
    )
    open: bool = option(default=True, help="Open the page in a browser.")

    @property
    def folder(self) -> Path:
        """Where the annotation is saved."""
        return self.output if self.output is not None else Path(f"{self.figure.stem}_annotation")
