"""Named effects of a picture, and which of them can be combined.

Nothing heavy is imported here, because the command line lists them in its help.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal, get_args

from fig2mesh.errors import InputError

Mode = Literal["textured", "clay", "normals", "depth", "parts"]
Effect = Literal["light", "sun", "shadow", "ao", "outline", "perspective", "blend", "smooth-union"]

MODES: tuple[Mode, ...] = get_args(Mode)

EFFECTS: dict[Effect, str] = {
    "light": "a lamp to the upper left of the viewer, and soft fill light",
    "sun": "sun and sky at --lonlat and --time, for a figure facing --facing",
    "shadow": "hard shadows of light or sun, on the figure and on --ground",
    "ao": "ambient occlusion, which darkens creases and corners",
    "outline": "an ink line where depth, normal or part changes abruptly",
    "perspective": "perspective instead of orthographic projection",
    "blend": "gradual transition between drawing and plain colours, by angle, instead of a hard border",
    "smooth-union": "rounded joints, where parts of a limb meet at an angle",
}
"""Effect → what it adds."""

SHADED: frozenset[Effect] = frozenset(("light", "sun", "shadow", "ao"))
"""Effects that change brightness, not allowed in modes whose colours are measurements."""

FIELDS_ONLY: frozenset[Effect] = frozenset(("blend", "smooth-union"))
"""Effects that are not available for a finished mesh."""


def parse_effects(texts: Iterable[str]) -> frozenset[Effect]:
    """Parse comma-separated lists of effects. Raises InputError for an unknown name."""
    names = [name.strip() for text in texts for name in text.split(",") if name.strip()]
    for name in names:
        if name not in EFFECTS:
            raise InputError("--effects", f"unknown effect {name!r}", f"choose from {', '.join(EFFECTS)}")
    return frozenset(names)  # type: ignore[arg-type]


def check_effects(mode: Mode, effects: frozenset[Effect], *, fields: bool) -> None:
    """Raise InputError for effects that cannot be combined with each other, the mode or the input.

    fields : whether the input is a drawing, of which part fields are made, and not a finished mesh
    """
    shaded = sorted(effects & SHADED)
    if shaded and mode in ("depth", "normals"):
        found = f"{shaded[0]} cannot be combined with --mode {mode}, whose colours are measurements"
        raise InputError("--effects", found, "leave it out, or use --mode textured, clay or parts")
    if {"light", "sun"} <= effects:
        raise InputError("--effects", "light cannot be combined with sun", "choose one of them")
    if "shadow" in effects and not effects & {"light", "sun"}:
        raise InputError("--effects", "shadow requires light or sun", "add one of them")
    if "blend" in effects and mode != "textured":
        raise InputError("--effects", f"blend cannot be combined with --mode {mode}", "use --mode textured")
    missing = sorted(effects & FIELDS_ONLY)
    if missing and not fields:
        found = f"{missing[0]} requires part fields, which a finished model does not have"
        raise InputError("--effects", found, "give the drawing instead of the model")
