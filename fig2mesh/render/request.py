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
    """A drawing or a finished model, and options for rendering it."""

    output: str = option(
        short="o",
        metavar="OUT",
        help="Output: .png for a still; .webp, .gif, .mp4 or a folder (of numbered PNGs) for a turntable.",
    )
    mode: Mode = option(default="textured", help="What the colours show.")
    effects: tuple[str, ...] = option(default=(), metavar="NAME,NAME…", help=f"Effects to add. {EFFECT_HELP}.")
    yaw: float = option(
        default=0.0,
        low=-3600,
        high=3600,
        metavar="DEG",
        help="Azimuth of the camera. 0: the figure's front; 90: its left side.",
    )
    pitch: float = option(default=0.0, low=-90, high=90, metavar="DEG", help="Elevation of the camera. 90: from above.")
    size: tuple[int, int] = option(
        default=(480, 640), low=1, high=8192, metavar="W H", help="Width and height, pixels."
    )
    samples: int | None = option(
        default=None,
        low=1,
        high=8,
        metavar="N",
        help="Rays along each side of a pixel. Default: 2; 1 for the modes depth and parts.",
    )
    background: str | None = option(
        default=None,
        metavar="COLOUR|transparent",
        help="Background. Default: transparent for PNG and WebP, white for GIF and MP4.",
    )
    ground: bool = option(
        default=False, help="Add a disc under the feet, which receives shadows; best with --pitch 15."
    )
    outline_width: float | None = option(
        default=None, low=0.1, high=100, metavar="PX", help="Width of the outline. Default: the drawn line's, else 1.5."
    )
    outline_colour: str = option(default="#221e1c", metavar="COLOUR", help="Colour of the outline.")
    lonlat: tuple[float, float] | None = option(
        default=None, metavar="LON LAT", help="For the effect sun: longitude and latitude, WGS 84 degrees."
    )
    time: str | None = option(
        default=None, metavar="ISO8601", help="For the effect sun: date and time, such as 2026-06-21T14:00+02:00."
    )
    facing: str = option(
        default="viewer",
        metavar="N|NE|…|DEG|viewer",
        help="For the effect sun: compass bearing of the nose. viewer: south.",
    )
    frames: int | None = option(
        default=None, low=1, metavar="N", default_text="36", help="Number of frames of a turntable."
    )
    fps: float | None = option(
        default=None, low=0.01, high=100, metavar="N", default_text="12.5", help="Frames per second."
    )
    seconds: float | None = option(
        default=None, low=0.01, high=10_000, metavar="S", help="Duration of a turntable, seconds."
    )
    report: Path | None = option(
        default=None, metavar="JSON", help="Write a report: rays, normals and samples that were needed."
    )
    overwrite: bool = option(default=False, help="Replace existing outputs.")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.mode == "textured" and self.textures == "none":
            raise InputError("--textures", "none cannot be combined with --mode textured", "use another --mode")
