"""Media types by file suffix, with a title for people and the role in a catalogue."""

from __future__ import annotations

from pathlib import PurePosixPath
from typing import NamedTuple


class MediaType(NamedTuple):
    """Media type of a file.

    type : as registered with IANA, if it is, https://www.iana.org/assignments/media-types; title : for people;
    role : "data", "metadata", "texture" or "source", see the STAC specification for the first two
    """

    type: str
    title: str
    role: str


BYTES = "application/octet-stream"

MEDIA_TYPES: dict[str, MediaType] = {
    ".glb": MediaType("model/gltf-binary", "glTF 2.0 binary", "data"),
    ".gltf": MediaType("model/gltf+json", "glTF 2.0", "data"),
    ".bin": MediaType("application/gltf-buffer", "buffer of glTF", "data"),
    ".b3dm": MediaType(BYTES, "Batched 3D Model of 3D Tiles 1.0", "data"),
    ".usda": MediaType("model/vnd.usda", "OpenUSD text", "data"),
    ".usdc": MediaType(BYTES, "OpenUSD binary", "data"),
    ".usdz": MediaType("model/vnd.usdz+zip", "OpenUSD package", "data"),
    ".obj": MediaType("model/obj", "Wavefront OBJ", "data"),
    ".mtl": MediaType("model/mtl", "materials of Wavefront OBJ", "data"),
    ".ply": MediaType(BYTES, "Stanford PLY", "data"),
    ".czml": MediaType("application/json", "CZML", "data"),
    ".geojson": MediaType("application/geo+json", "GeoJSON", "data"),
    ".gpkg": MediaType("application/geopackage+sqlite3", "GeoPackage", "data"),
    ".json": MediaType("application/json", "JSON", "metadata"),
    ".jsonl": MediaType("application/x-ndjson", "JSON Lines", "metadata"),
    ".csv": MediaType("text/csv", "CSV", "metadata"),
    ".html": MediaType("text/html", "HTML", "metadata"),
    ".txt": MediaType("text/plain", "text", "metadata"),
    ".jpeg": MediaType("image/jpeg", "JPEG picture", "source"),
    ".jpg": MediaType("image/jpeg", "JPEG picture", "source"),
    ".ktx2": MediaType("image/ktx2", "KTX 2 texture", "texture"),
    ".png": MediaType("image/png", "PNG picture", "source"),
    ".svg": MediaType("image/svg+xml", "SVG picture", "source"),
    ".tif": MediaType("image/tiff", "TIFF picture", "source"),
    ".tiff": MediaType("image/tiff", "TIFF picture", "source"),
    ".webp": MediaType("image/webp", "WebP picture", "source"),
}

TILESET = MediaType("application/json", "3D Tiles", "data")


def media_type(path: str) -> MediaType:
    """Return the media type of a path with slashes: `tileset.json` is 3D Tiles, pictures named texture are textures."""
    name = PurePosixPath(path)
    if name.name == "tileset.json":
        return TILESET
    found = MEDIA_TYPES.get(name.suffix.lower(), MediaType(BYTES, name.suffix.lstrip(".").upper() or "file", "data"))
    if found.role == "source" and "texture" in name.stem:
        return found._replace(title=found.title.replace("picture", "texture"), role="texture")
    return found
