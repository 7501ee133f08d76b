"""The library that reads parts of large pictures and converts colours, made safe for untrusted files."""

from __future__ import annotations

import logging
from typing import Any


def libvips() -> Any:
    """The library, with decoders that are unsafe for untrusted files disabled (SVG, PDF, ImageMagick's)."""
    import pyvips

    # The log of libvips only repeats its errors.
    logging.getLogger("pyvips").setLevel(logging.ERROR)
    pyvips.block_untrusted_set(True)
    # Its cache is keyed by file names: it would return the old content of a file that was written again.
    pyvips.cache_set_max(0)
    return pyvips
