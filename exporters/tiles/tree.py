"""3D Tiles of many figures: an explicit tree by place, in as many tileset files as keep each of them small.

https://docs.ogc.org/cs/22-025r4/22-025r4.html

Inner tiles have no content, only a box in ECEF round everything below. Their geometric error is the largest of those
of the figures below, whose ranges are the distances that these are drawn from, and they refine by ADD: then CesiumJS
tests each child's own distance against the error of its parent, and what lies farther away is neither visited nor
loaded. A figure with a smaller range than others in its leaf has an inner tile of its own between, so that every figure
is drawn from just as far as if it had a tileset of its own. Larger errors higher up would gain nothing, since a box is
never farther away than what it holds.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Any

import numpy as np

from exporters.placed_figure import PlacedFigure
from exporters.tiles.place_tree import PlaceNode, figure_box, figure_corners, place_tree
from exporters.tiles.tileset import TilesVersion, check_distance, figure_tile, visible_error

FIGURES_PER_FILE = 512
"""Largest number of figures in one tileset file, about 0.5 MB, and of further files that one refers to."""


def _property(kind: str, description: str, required: bool = False, **more: Any) -> dict[str, Any]:
    return {"type": kind, **more, **({"required": True} if required else {}), "description": description}


_FLOAT: dict[str, Any] = {"componentType": "FLOAT64"}

SCHEMA: dict[str, Any] = {
    "id": "fig2mesh_figures",
    "classes": {
        "collection": {
            "name": "Figures on the globe",
            "properties": {
                "figures": _property("SCALAR", "Number of figures", True, componentType="UINT32"),
            },
        },
        "figure": {
            "name": "Drawn figure",
            "properties": {
                "name": _property("STRING", "Name of the figure", True, semantic="NAME"),
                "source": _property("STRING", "Picture that it was made from"),
                "copyright": _property("STRING", "Attribution"),
                "parts": _property("STRING", "Names of its body parts", array=True),
                "partsObservedShare": _property(
                    "SCALAR", "Per part, share of its surface that the drawing itself shows", array=True, **_FLOAT
                ),
                "observedShare": _property("SCALAR", "Share of the surface that the drawing itself shows", **_FLOAT),
                "longitude": _property("SCALAR", "WGS 84, degrees east", True, **_FLOAT),
                "latitude": _property("SCALAR", "WGS 84, degrees north", True, **_FLOAT),
                "height": _property("SCALAR", "Of the feet above the ellipsoid, metres", True, **_FLOAT),
                "heading": _property("SCALAR", "Compass bearing of the nose, degrees", True, **_FLOAT),
                "figureHeight": _property("SCALAR", "Height of the drawn figure, metres", True, **_FLOAT),
            },
        },
    },
}
"""Schema of the metadata; the same in every file, as CesiumJS looks into that of the first one only."""


def figure_properties(figure: PlacedFigure) -> dict[str, Any]:
    """The values of class `figure` in `SCHEMA`; what is unknown is left out."""
    place = figure.placement
    values: dict[str, Any] = {
        "name": figure.name,
        "source": figure.source or None,
        "copyright": figure.copyright or None,
        "parts": list(figure.parts) or None,
        "partsObservedShare": list(figure.shares) or None,
        "observedShare": figure.observed,
        "longitude": place.lon_deg,
        "latitude": place.lat_deg,
        "height": place.height_m,
        "heading": place.heading_deg,
        "figureHeight": place.figure_height_m,
    }
    return {key: value for key, value in values.items() if value is not None}


@dataclass(frozen=True)
class _Writer:
    figures: Sequence[PlacedFigure]
    errors: Sequence[float]
    version: TilesVersion
    stem: str
    digits: int

    def documents(self, node: PlaceNode, name: str, numbers: Iterator[int]) -> Iterator[tuple[str, dict[str, Any]]]:
        """The file that begins at a node, after those that it refers to."""
        limit = FIGURES_PER_FILE
        while limit * FIGURES_PER_FILE < node.count:
            limit *= FIGURES_PER_FILE
        further: list[tuple[PlaceNode, str]] = []
        root = self.tile(node, limit, node, further, numbers)
        for inner, file in further:
            yield from self.documents(inner, file, numbers)
        asset = {"asset": {"version": self.version, "generator": "fig2mesh"}}
        schema = {"schema": SCHEMA} if self.version == "1.1" else {}
        yield name, {**asset, **schema, "geometricError": root["geometricError"], "root": root}

    def tile(
        self,
        node: PlaceNode,
        limit: int,
        top: PlaceNode,
        further: list[tuple[PlaceNode, str]],
        numbers: Iterator[int],
    ) -> dict[str, Any]:
        error = self.error(node)
        tile = _inner_tile(node.box, error)
        if node is not top and node.count <= limit < top.count:
            file = f"{self.stem}_{next(numbers):0{self.digits}d}.json"
            further.append((node, file))
            return tile | {"content": {"uri": file}}
        inner = [self.tile(child, limit, top, further, numbers) for child in node.children]
        return tile | {"children": inner + [self.leaf(index, error) for index in node.figures]}

    def error(self, node: PlaceNode) -> float:
        """Largest error of the figures below a node."""
        below = [self.error(child) for child in node.children]
        return max(below + [self.errors[index] for index in node.figures])

    def leaf(self, index: int, above: float) -> dict[str, Any]:
        """The tile of a figure; in one that shortens its range where the error above it is larger than its own."""
        figure, error = self.figures[index], self.errors[index]
        tile = figure_tile(figure, self.facts(figure))
        if error >= above:
            return tile
        box = figure_box(figure.placement, figure.low, figure.high)
        return _inner_tile(box, error) | {"children": [tile]}

    def facts(self, figure: PlacedFigure) -> dict[str, Any]:
        properties = figure_properties(figure)
        if self.version == "1.0":
            return {"extras": properties}
        # On every level of detail: CesiumJS's getPropertyInherited looks at a content's own tile, not above it.
        return {"metadata": {"class": "figure", "properties": properties}}


def _inner_tile(box: tuple[float, ...], error: float) -> dict[str, Any]:
    return {"boundingVolume": {"box": list(box)}, "geometricError": error, "refine": "ADD"}


def tileset_documents(
    figures: Sequence[PlacedFigure],
    visible_from_m: float | None = None,
    version: TilesVersion = "1.1",
    name: str = "tileset.json",
) -> Iterator[tuple[str, dict[str, Any]]]:
    """The tileset files of figures, one after the other: file name and document, the one to open last.

    figures : at least one; `contents` as seen from the folder of the files. Their order decides the order of tiles
        only among figures at equal coordinates
    visible_from_m : distance from which a figure is drawn at all, on a screen of 1080 rows; None: of each figure,
        `exporters.tiles.tileset.visible_range` of its height
    version : of 3D Tiles; 1.0 has no metadata, so its tiles tell the same in `extras`
    name : of the file to open; further ones are called after it

    Raises ExportError for a distance that is not positive.
    """
    check_distance(visible_from_m)
    tree = place_tree(np.array([figure_corners(each.placement, each.low, each.high) for each in figures]))
    errors = [visible_error(visible_from_m, each.placement.figure_height_m, each.errors[-1]) for each in figures]
    files = -(-len(figures) // FIGURES_PER_FILE)
    writer = _Writer(figures, errors, version, PurePosixPath(name).stem, len(str(2 * files)))
    facts = {"figures": len(figures)}
    metadata = {"class": "collection", "properties": facts}
    for file, document in writer.documents(tree, name, iter(range(1, 1 << 62))):
        if file == name:
            document |= {"metadata": metadata} if version == "1.1" else {"extras": facts}
        yield file, document
