"""Profiles of clients: the choices of `--profile`, each with its reason.

Without a profile a file has only features that every client reads. A file with a profile is an additional one for its
client: others may reject it (`extensionsRequired`) or show less.

`cesiumjs`: geometry quantised and compressed with EXT_meshopt_compression, the texture as lossless WebP. Both are
required, since a copy for other clients in the same file would cost more than compression saves.
`cesiumjs-ktx2`: the same with the texture as KTX 2 (ETC1S), which stays compressed in graphics memory: for
maps with many figures. Lossy.
`blender`: no extension at all. Blender converts unlit materials to a group of nodes that ignores lamps, and has no
part tables; it reads attributes that begin with an underscore, and extras of nodes as custom properties.
`qgis`: no extension at all, the texture as PNG. QGIS 3.34 and later show textured tiles unlit, and support
only float positions, no vertex colours and no compression but Draco's (src/3d/qgsgltf3dutils.cpp); its 3D symbols
are read by Assimp.
`omniverse`: USD in its binary form; long arrays are slow to read as text.

https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Vendor/EXT_meshopt_compression
https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Khronos/KHR_texture_basisu
https://github.com/CesiumGS/cesium/blob/main/CHANGES.md
https://docs.blender.org/manual/en/latest/addons/import_export/scene_gltf2.html
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from exporters.errors import ExportError
from exporters.gltf.ktx2 import encoder
from exporters.gltf.meshopt import codec

TILES = "3D Tiles"
"""Represents tilesets among the suffixes that a client reads."""

TextureKind = Literal["png", "webp", "ktx2"]


@dataclass(frozen=True)
class Profile:
    """Choices for the files of one client.

    name : as on the command line, empty for the general profile
    client : its name for people
    reads : suffixes of the files that it reads, `TILES` for tilesets; all if empty
    extensions : whether glTF files may have optional extensions: unlit material, part table, solid, XMP
    vertex_colors : whether it shows COLOR_0; if not, an untextured figure has the mean colour
    compressed : whether glTF geometry is quantised and compressed with meshopt
    texture : format of the texture in glTF files
    """

    name: str = ""
    client: str = "every client"
    reads: tuple[str, ...] = ()
    extensions: bool = True
    vertex_colors: bool = True
    compressed: bool = False
    texture: TextureKind = "png"

    def check_tools(self) -> None:
        """Raise ExportError where the profile needs a package that is not installed."""
        if self.compressed:
            codec()
        if self.texture == "ktx2":
            encoder()

    def check(self, path: str, suffix: str) -> None:
        """Raise ExportError for an output that the client does not read; suffix : in lower case, or `TILES`."""
        if self.reads and suffix not in self.reads:
            known = ", ".join(self.reads)
            raise ExportError(
                path, f"--profile {self.name} cannot be combined with {suffix}", f"{self.client} reads {known}"
            )

    @property
    def texture_ending(self) -> str:
        """Ending of the name of the texture of a .gltf file."""
        return f"_texture.{self.texture}"


GENERAL = Profile()

_CESIUMJS = (".glb", ".gltf", ".czml", ".geojson", TILES)
_USD = (".usda", ".usdc", ".usdz")

PROFILES = {
    profile.name: profile
    for profile in (
        Profile("cesiumjs", "CesiumJS", (".glb", ".gltf", ".czml", ".geojson", TILES), compressed=True, texture="webp"),
        Profile(
            "cesiumjs-ktx2", "CesiumJS", (".glb", ".gltf", ".czml", ".geojson", TILES), compressed=True, texture="ktx2"
        ),
        Profile("blender", "Blender", (".glb", ".gltf", *_USD, ".ply", ".obj"), extensions=False),
        Profile("qgis", "QGIS", (".glb", ".gltf", ".obj", ".geojson", TILES), extensions=False, vertex_colors=False),
        Profile("omniverse", "Omniverse", (".usdc", ".usdz", TILES)),
    )
}
"""Profiles by name."""


def profile_named(name: str | None) -> Profile:
    """Return the profile of a name, `GENERAL` for None. Raises ExportError for an unknown name."""
    if name is None:
        return GENERAL
    if name not in PROFILES:
        raise ExportError("--profile", f"unknown profile {name!r}", f"choose from {', '.join(PROFILES)}")
    return PROFILES[name]


def suffix_of(path: Path) -> str:
    """Suffix of a main file as used by `Profile.check`."""
    return TILES if path.name == "tileset.json" else path.suffix.lower()
