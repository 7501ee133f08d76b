"""Facts about a tileset by py3dtiles, an independent reader.

python py3dtiles_levels.py TILESET_JSON; stdout: [{geometric_error, uri, triangles, inside, feet}, ...], coarse to fine;
`inside`: all vertices lie in the tile's volume; `feet`: ECEF of the content's origin
https://py3dtiles.org/
"""

import json
import sys
from pathlib import Path

import numpy as np
from py3dtiles.tileset.content.gltf import Gltf
from py3dtiles.tileset.tileset import TileSet


def main() -> None:
    tileset = TileSet.from_file(Path(sys.argv[1]))
    pending, found = [(tileset.root_tile, np.eye(4))], []
    while pending:
        tile, above = pending.pop(0)
        ecef_from_tile = above @ tile.transform
        pending += [(child, ecef_from_tile) for child in tile.children]
        if not tile.has_content():
            continue
        content = tile.get_or_fetch_content(tileset.root_uri)
        assert isinstance(content, Gltf), type(content)
        x, y, z = content.get_vertices().T
        centre, axes = tile.bounding_volume._box[:3], tile.bounding_volume._box[3:].reshape(3, 3)
        offset = np.stack([x, -z, y], axis=1) - centre  # content is y-up, volumes are z-up
        inside = bool((np.abs(offset @ axes.T) <= (axes**2).sum(axis=1) + 1e-9).all())
        found.append(
            {
                "geometric_error": tile.geometric_error,
                "uri": str(tile.content_uri),
                "triangles": len(x) // 3,
                "inside": inside,
                "feet": ecef_from_tile[:3, 3].tolist(),
            }
        )
    print(json.dumps(found))


main()
