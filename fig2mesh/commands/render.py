"""`fig2mesh render`: pictures of drawings and models; nothing heavy is imported before."""

from __future__ import annotations

from typing import Any

import click

from fig2mesh.commands.options import FILE, figure_files, messages
from fig2mesh.render.effects import EFFECTS, MODES

EFFECT_HELP = "; ".join(f"{name}: {title}" for name, title in EFFECTS.items())


@click.command()
@click.argument("source", type=FILE, metavar="FIGURE|MODEL")
@click.option(
    "-o",
    "--output",
    required=True,
    metavar="OUT",
    help=".png: a still; .webp, .gif, .mp4: a turntable; a folder: its pictures as numbered PNGs.",
)
@click.option("--mode", type=click.Choice(MODES), default="textured", show_default=True, help="What colours mean.")
@click.option("--effects", multiple=True, metavar="NAME,NAME…", help=f"None unless asked for. {EFFECT_HELP}.")
@click.option(
    "--yaw",
    type=click.FloatRange(-3600, 3600),
    default=0.0,
    show_default=True,
    metavar="DEG",
    help="0 sees the front, 90 the figure's left side.",
)
@click.option(
    "--pitch",
    type=click.FloatRange(-90, 90),
    default=0.0,
    show_default=True,
    metavar="DEG",
    help="90 looks down.",
)
@click.option(
    "--size",
    type=click.IntRange(1, 8192),
    nargs=2,
    default=(480, 640),
    show_default=True,
    metavar="W H",
    help="Pixels.",
)
@click.option(
    "--samples",
    type=click.IntRange(1, 8),
    metavar="N",
    help="Rays along each side of a pixel. Default: 2, but 1 where colours are depths or parts.",
)
@click.option(
    "--background",
    metavar="COLOUR|transparent",
    help="Default: transparent for PNG and WebP, white for GIF and MP4.",
)
@click.option("--ground", is_flag=True, help="A disc under the feet, which takes shadows; look at it with --pitch 15.")
@click.option("--outline-width", type=click.FloatRange(0.1, 100), default=1.5, show_default=True, metavar="PX")
@click.option("--outline-colour", default="#221e1c", show_default=True, metavar="COLOUR")
@click.option("--lonlat", type=float, nargs=2, metavar="LON LAT", help="For sun: the place on WGS 84, degrees.")
@click.option("--time", "time_", metavar="ISO8601", help="For sun: the moment, such as 2026-06-21T14:00+02:00.")
@click.option(
    "--facing",
    default="viewer",
    metavar="N|NE|…|DEG|viewer",
    show_default=True,
    help="For sun: compass bearing of the nose; viewer: south.",
)
@click.option("--frames", type=click.IntRange(1), metavar="N", help="Pictures of a turn.  [default: 36]")
@click.option("--fps", type=click.FloatRange(0.01, 100), metavar="N", help="Pictures a second.  [default: 12.5]")
@click.option("--seconds", type=click.FloatRange(0.01, 10_000), metavar="S", help="Length of a turn.")
@figure_files
@click.option("--quality", type=click.Choice(["draft", "standard", "fine"]), default="standard", show_default=True)
@click.option("--parts", type=click.Choice(["network", "outline"]), default="network", show_default=True)
@click.option("--textures", type=click.Choice(["network", "plain", "none"]), help="As in the main job.")
@click.option("--contours", type=click.Choice(["keep", "drop"]), default="keep", show_default=True)
@click.option("--device", type=click.Choice(["auto", "cpu", "cuda"]), default="auto", show_default=True)
@click.option("--seed", type=click.IntRange(0, 2**31 - 1), default=0, show_default=True)
@click.option("--report", type=FILE, metavar="JSON", help="What was needed and counted: rays, normals, samples.")
@click.option("--overwrite", is_flag=True, help="Replace existing outputs.")
@messages
def render(**options: Any) -> None:
    """Make pictures of FIGURE, traced through its part fields, or of MODEL (.glb .gltf .ply .obj)."""
    from fig2mesh.render.job import run

    run(**options)


def add_to(cli: click.Group) -> None:
    """Make `render` a command of `cli`."""
    cli.add_command(render)
