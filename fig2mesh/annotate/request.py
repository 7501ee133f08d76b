"""Request of `fig2mesh annotate`."""

from __future__ import annotations

from pathlib import Path

from fig2mesh.conversion.fields import option, request_class
from fig2mesh.conversion.request import FigureFiles
from fig2mesh.settings import Parts


@request_class
class AnnotateRequest(FigureFiles):
    """A figure to annotate by hand, and the output folder."""

    output: Path | None = option(
        default=None,
        short="o",
        metavar="DIR",
        help="Folder for keypoints.json, mask.png and part_labels.png; files already there are loaded, and overwritten "
        "on save. Default: FIGURE without its suffix + _annotation, in the current folder.",
    )
    parts: Parts = option(
        default="network", help="Method for the shapes of parts in the preview, as in the main command."
    )
    port: int = option(
        default=0, low=0, high=65535, metavar="N", default_text="a free one", help="Port of the local web server."
    )
    open: bool = option(default=True, help="Open the page in a browser.")

    @property
    def folder(self) -> Path:
        """Output folder of the annotation."""
        return self.output if self.output is not None else Path(f"{self.figure.stem}_annotation")
