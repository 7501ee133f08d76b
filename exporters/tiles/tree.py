"""3D Tiles of many figures: an explicit spatial tree, split into small tileset files.

https://docs.ogc.org/cs/22-025r4/22-025r4.html

Inner tiles have no content, only a box in ECEF around all descendants. Their geometric error is the largest error of
the figures below, which sets their visible range, and they refine by ADD: then CesiumJS tests each child's own distance
against the error of its parent, and farther tiles are neither visited nor loaded. A figure with a smaller range than
others in its leaf gets an inner tile of its own in between, so that every figure is drawn up to the same distance as in
a tileset of its own. Larger errors higher up would gain nothing, since a box is never farther away than its contents.
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
"""Maximum number of figures in one tileset file, about 0.5 MB, and of further files that it refers to."""


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
"""Schema of the metadata; the same in every file, as CesiumJS uses only that of the first one."""


def figure_properties(figure: PlacedFigure) -> dict[str, Any]:
    """Return the values of class `figure` in `SCHEMA`, without unknown ones."""
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
        """Generate the file whose root is a node, after those that it refers to."""
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
        """Return the largest error of the figures below a node."""
        below = [self.error(child) for child in node.children]
        return max(below + [self.errors[index] for index in node.figures])

    def leaf(self, index: int, above: float) -> dict[str, Any]:
        """Return the tile of a figure, inside one that limits its range if the error above is larger than its own."""
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
        # On every level of detail: CesiumJS's getPropertyInherited uses only a content's own tile, not its parents.
        return {"metadata": {"class": "figure", "properties": properties}}


def _inner_tile(box: tuple[float, ...], error: float) -> dict[str, Any]:
    return {"boundingVolume": {"box": list(box)}, "geometricError": error, "refine": "ADD"}


def tileset_documents(
    figures: Sequence[PlacedFigure],
    visible_from_m: float | None = None,
    version: TilesVersion = "1.1",
    name: str = "tileset.json",
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Generate the tileset files of figures: file name and document, the root file last.

    figures : at least one; `contents` relative to the folder of the files. Their order affects the order of tiles only
        among figures at equal coordinates
    visible_from_m : distance up to which a figure is drawn, on a screen of 1080 rows; None: of each figure,
        `exporters.tiles.tileset.visible_range` of its height
    version : of 3D Tiles; 1.0 has no metadata, so its tiles have the same values in `extras`
    name : of the root file, from which the names of further files are derived

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
