"""Texture files of models: pictures, and KTX 2."""

from __future__ import annotations

from exporters.gltf.ktx2 import IDENTIFIER, size_of
from georef.untrusted.image_file import picture_size


def texture_size(data: bytes) -> list[int]:
    """Width and height of an image file, also of KTX 2. Raises DamagedFile where it cannot be determined."""
    return list(size_of(data) if data.startswith(IDENTIFIER) else picture_size(data))
