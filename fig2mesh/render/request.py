"""Request of `fig2mesh render`."""

from __future__ import annotations

from pathlib import Path

from fig2mesh.conversion.fields import option, request_class
from fig2mesh.conversion.request import FigureFiles, InferenceOptions
from fig2mesh.errors import InputError
from fig2mesh.render.effects import EFFECTS, Mode

EFFECT_HELP = "; ".join(f"{name}: {title}" for name, title in EFFECTS.items())


@request_class
class RenderRequest(FigureFiles, InferenceOptions):
    """A drawing or a finished model, and the pictures to make of it."""

    output: str = option(
        short="o",
        metavar="OUT",
        help=".png: a still; .webp, .gif, .mp4: a turntable; a folder: its pictures as numbered PNGs.",
    )
    mode: Mode = option(default="textured", help="What colours mean.")
    effects: tuple[str, ...] = option(default=(), metavar="NAME,NAME…", help=f"None unless asked for. {EFFECT_HELP}.")
    yaw: float = option(
        default=0.0, low=-3600, high=3600, metavar="DEG", help="0 sees the front, 90 the figure's left side."
    )
    pitch: float = option(default=0.0, low=-90, high=90, metavar="DEG", help="90 looks down.")
    size: tuple[int, int] = option(default=(480, 640), low=1, high=8192, metavar="W H", help="Pixels.")
    samples: int | None = option(
        default=None,
        low=1,
        high=8,
        metavar="N",
        help="Rays along each side of a pixel. Default: 2, but 1 where colours are depths or parts.",
    )
    background: str | None = option(
        default=None, metavar="COLOUR|transparent", help="Default: transparent for PNG and WebP, white for GIF and MP4."
    )
    ground: bool = option(default=False, help="A disc under the feet, which takes shadows; look at it with --pitch 15.")
    outline_width: float = option(default=1.5, low=0.1, high=100, metavar="PX", help="Of the ink lines.")
    outline_colour: str = option(default="#221e1c", metavar="COLOUR", help="Of the ink lines.")
    lonlat: tuple[float, float] | None = option(
        default=None, metavar="LON LAT", help="For sun: the place on WGS 84, degrees."
    )
    time: str | None = option(
        default=None, metavar="ISO8601", help="For sun: the moment, such as 2026-06-21T14:00+02:00."
    )
    facing: str = option(
        default="viewer", metavar="N|NE|…|DEG|viewer", help="For sun: compass bearing of the nose; viewer: south."
    )
    frames: int | None = option(default=None, low=1, metavar="N", default_text="36", help="Pictures of a turn.")
    fps: float | None = option(
        default=None, low=0.01, high=100, metavar="N", default_text="12.5", help="Pictures a second."
    )
    seconds: float | None = option(default=None, low=0.01, high=10_000, metavar="S", help="Length of a turn.")
    report: Path | None = option(
        default=None, metavar="JSON", help="What was needed and counted: rays, normals, samples."
    )
    overwrite: bool = option(default=False, help="Replace existing outputs.")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.mode == "textured" and self.textures == "none":
            raise InputError("--textures", "none, but --mode textured shows them", "use another --mode")
