"""The named effects of a picture, and which of them go together.

Nothing heavy is imported here: the command line lists them in its help.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal, get_args

from fig2mesh.errors import InputError

Mode = Literal["textured", "clay", "normals", "depth", "parts"]
Effect = Literal["light", "sun", "shadow", "ao", "outline", "perspective", "blend", "smooth-union"]

MODES: tuple[Mode, ...] = get_args(Mode)

EFFECTS: dict[Effect, str] = {
    "light": "a lamp to the upper left of the viewer, and soft fill",
    "sun": "the sun as it stands at --lonlat and --time over a figure facing --facing, and the sky",
    "shadow": "hard shadows of light or sun, on the figure itself and on --ground",
    "ao": "ambient occlusion: creases and corners get less of the light that comes from everywhere",
    "outline": "an ink line where depth, direction or part of the surface changes",
    "perspective": "a camera nearby instead of one far away",
    "blend": "drawing and plain colours pass into each other with the angle, instead of at a border",
    "smooth-union": "rounded joints: parts of a limb melt together where they meet at an angle",
}
"""Effect → what it adds."""

SHADED: frozenset[Effect] = frozenset(("light", "sun", "shadow", "ao"))
"""Effects that change brightness; pictures whose colours are measures cannot have them."""

FIELDS_ONLY: frozenset[Effect] = frozenset(("blend", "smooth-union"))
"""Effects that a finished mesh has no means for."""


def parse_effects(texts: Iterable[str]) -> frozenset[Effect]:
    """Effects of comma-separated lists of names. Raises InputError for a name that is none."""
    names = [name.strip() for text in texts for name in text.split(",") if name.strip()]
    for name in names:
        if name not in EFFECTS:
            raise InputError("--effects", f"{name!r} is no effect", f"choose from {', '.join(EFFECTS)}")
    return frozenset(names)  # type: ignore[arg-type]


def check_effects(mode: Mode, effects: frozenset[Effect], *, fields: bool) -> None:
    """Refuse what cannot be drawn together.

    fields : whether a drawing is given, of which part fields are made, and not a finished mesh
    """
    shaded = sorted(effects & SHADED)
    if shaded and mode in ("depth", "normals"):
        found = f"{shaded[0]} would falsify the measures that --mode {mode} shows"
        raise InputError("--effects", found, "leave it out, or use --mode textured, clay or parts")
    if {"light", "sun"} <= effects:
        raise InputError("--effects", "light and sun are two lamps", "choose one of them")
    if "shadow" in effects and not effects & {"light", "sun"}:
        raise InputError("--effects", "nothing casts the shadow", "add light or sun")
    if "blend" in effects and mode != "textured":
        raise InputError("--effects", f"blend mixes textures, which --mode {mode} has not", "use --mode textured")
    missing = sorted(effects & FIELDS_ONLY)
    if missing and not fields:
        found = f"{missing[0]} is done on the part fields, which a finished model has not"
        raise InputError("--effects", found, "give the drawing instead of the model")
