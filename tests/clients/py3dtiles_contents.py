"""Facts about a tileset of many figures by py3dtiles, an independent reader.

python py3dtiles_contents.py TILESET_JSON
stdout: {version, tiles, contents: {uri: {kind, vertices, batch}}}; uri as its tile has it
https://py3dtiles.org
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from py3dtiles.tileset.content import B3dm
from py3dtiles.tileset.tileset import TileSet

found = {"contents": {}, "tiles": 0}


def visit(tile, folder):
    found["tiles"] += 1
    assert tile.bounding_volume.is_valid()
    if tile.has_content():
        content = tile.get_or_fetch_content(folder)
        if isinstance(content, TileSet):
            visit(content.root_tile, folder)
        else:
            batch = content.body.batch_table.header.data if isinstance(content, B3dm) else None
            found["contents"][str(tile.content_uri)] = {
                "kind": type(content).__name__,
                "vertices": int(content.get_vertex_count()),
                "batch": batch,
            }
    for child in tile.children:
        visit(child, folder)


path = Path(sys.argv[1])
tileset = TileSet.from_file(path)
found["version"] = tileset.asset.version.value
visit(tileset.root_tile, path.parent)
print(json.dumps(found))
