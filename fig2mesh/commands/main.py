"""The command line: a skin over `fig2mesh.convert.job`; data on stdout, progress and messages on stderr.

Nothing heavy is imported before it is needed: `fig2mesh --help` loads only click.
"""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from fig2mesh import __version__
from fig2mesh.commands import annotate as annotate_cli
from fig2mesh.commands import batch as batch_cli
from fig2mesh.commands import data as data_cli
from fig2mesh.commands import globe as globe_cli
from fig2mesh.commands import parse as parse_cli
from fig2mesh.commands import render as render_cli
from fig2mesh.commands import tileset as tileset_cli
from fig2mesh.commands import train as training_cli
from fig2mesh.commands import view as view_cli
from fig2mesh.commands.doctor import doctor
from fig2mesh.commands.options import FILE, figure_files, messages, place_options
from fig2mesh.commands.tradeoff import tradeoff
from fig2mesh.settings import EFFECTS


class MainJobGroup(click.Group):
    """A group whose first argument may be a figure: then the main job runs."""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if args and args[0] not in self.commands:
            return "make", self.commands["make"], args
        return super().resolve_command(ctx, args)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        # Options of the main job may come before the figure; the group itself only knows these two.
        if args and args[0] not in (*self.commands, "-h", "--help", "--version"):
            args = ["make", *args]
        return super().parse_args(ctx, args)

    def format_usage(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        formatter.write_usage("fig2mesh", "FIGURE [OPTIONS]", "Usage: ")
        formatter.write_usage("fig2mesh", "COMMAND [ARGS]...", "       ")

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        main_job = self.commands["make"]
        records = [record for p in main_job.get_params(ctx) if (record := p.get_help_record(ctx)) is not None]
        with formatter.section("Options of the main job"):
            formatter.write_dl(records)
        self.format_commands(ctx, formatter)


@click.group(
    cls=MainJobGroup,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
    invoke_without_command=False,
)
@click.version_option(__version__, prog_name="fig2mesh")
def cli() -> None:
    """Turn one drawn human figure into a closed, textured, georeferenced 3D model.

    FIGURE is a picture of one figure. Its silhouette is the transparency or --mask, its joints are --keypoints; what
    is missing is inferred from the picture.
    """


@cli.command("make", hidden=True)
@click.argument("figure", type=FILE)
@place_options
@click.option(
    "--altitude-mode",
    type=click.Choice(["absolute", "clamp"]),
    default="absolute",
    show_default=True,
    help="clamp: --altitude is above the terrain that a client shows, where the format can say so (CZML).",
)
@click.option(
    "-o",
    "--output",
    "outputs",
    multiple=True,
    metavar="OUT",
    help=".glb .gltf .usda .usdc .usdz .ply .obj .czml .geojson, or a folder / tileset.json for 3D Tiles; repeatable. "
    "Default: FIGURE's stem + .glb in the current folder.",
)
@click.option(
    "--profile",
    type=click.Choice(["cesiumjs", "cesiumjs-ktx2", "blender", "qgis", "omniverse"]),
    help="Write for one client: cesiumjs compressed (also with KTX 2 texture), blender and qgis without extensions, "
    "omniverse as binary USD. Default: what every client takes.",
)
@figure_files
@click.option("--quality", type=click.Choice(["draft", "standard", "fine"]), default="standard", show_default=True)
@click.option("--triangles", type=click.IntRange(200, 2_000_000), metavar="N", help="Triangles of the finest mesh.")
@click.option("--texture-size", type=click.IntRange(64, 8192), metavar="PX", help="Texels a side.")
@click.option(
    "--lods", type=click.IntRange(1, 5), default=1, show_default=True, help="Levels of detail (3D Tiles, USD)."
)
@click.option(
    "--visible-from",
    type=float,
    metavar="M",
    help="Distance from which the figure is drawn, 3D Tiles only; default: about 1,100 times its height.",
)
@click.option(
    "--tiles-version",
    type=tileset_cli.TILES_VERSION,
    default="1.1",
    show_default=True,
    help="Of 3D Tiles; 1.0: content as .b3dm, for older clients.",
)
@click.option(
    "--parts",
    type=click.Choice(["network", "outline"]),
    default="network",
    show_default=True,
    help="What depths come from: networks, or rules and the outline alone.",
)
@click.option(
    "--textures",
    type=click.Choice(["network", "plain", "none"]),
    help="Unseen sides as networks paint them (default), or in the plain colours of what is drawn before them (default "
    "with --parts outline); or no texture at all.",
)
@click.option(
    "--contours",
    type=click.Choice(["keep", "drop"]),
    default="keep",
    show_default=True,
    help="The line drawn around the figure: on the surface, like the drawing from the front and a dark band from the "
    "side; or left away, for clients that draw silhouettes.",
)
@click.option(
    "--effect",
    "effects",
    type=click.Choice(EFFECTS),
    multiple=True,
    help="light: clients light the surface (default without texture); none: they show it as it is. Repeatable.",
)
@click.option("--mesher", type=click.Choice(["ball-pivot", "isosurface"]), default="ball-pivot", show_default=True)
@click.option("--closing", type=click.Choice(["pymeshlab", "fill"]), default="pymeshlab", show_default=True)
@click.option("--device", type=click.Choice(["auto", "cpu", "cuda"]), default="auto", show_default=True)
@click.option("--seed", type=click.IntRange(0, 2**31 - 1), default=0, show_default=True)
@click.option("--name", metavar="TEXT", help="What the figure is called in the outputs; default: FIGURE's stem.")
@click.option("--credit", default="", metavar="TEXT", help="Attribution, kept in the outputs.")
@click.option(
    "--evidence/--no-evidence",
    default=True,
    show_default=True,
    help="Part names and how much of each the drawing showed, as glTF feature ids.",
)
@click.option("--save-stages", type=FILE, metavar="DIR", help="Keep what each stage made.")
@click.option("--resume-from", metavar="STAGE", help="Start at STAGE with what --save-stages DIR holds.")
@click.option("--report", type=FILE, metavar="JSON", help="Seconds, memory, measures, versions, hashes.")
@click.option("--overwrite", is_flag=True, help="Replace existing outputs.")
@messages
def make(**options: Any) -> None:
    """Make a 3D model of FIGURE."""
    from fig2mesh.convert.job import run

    run(**options)


@cli.command("plan", params=[*make.params, click.Option(["--json", "as_json"], is_flag=True, help="One JSON object.")])
def show_plan(as_json: bool, **options: Any) -> None:
    """Print which stages and effects a request needs, and why; the options are those of the main job."""
    from fig2mesh.convert.job import plan_of

    planned = plan_of(**options)
    if as_json:
        click.echo(json.dumps(asdict(planned), indent=2))
        return
    for each in (*planned.stages, *planned.effects):
        click.echo(f"{'run ' if each.runs else 'skip'}  {each.name:<9} {each.why}")


@cli.command()
@click.argument("files", type=FILE, nargs=-1, required=True)
@click.option("--json", "as_json", is_flag=True, help="One JSON object instead of lines.")
def inspect(files: tuple[Path, ...], as_json: bool) -> None:
    """Say what is in a GLB, tileset, USD, PLY or OBJ file."""
    from exporters.inspect import inspect as look

    facts = {str(path): look(path) for path in files}
    if as_json:
        click.echo(json.dumps(next(iter(facts.values())) if len(facts) == 1 else facts, indent=2))
        return
    for path, found in facts.items():
        click.echo(path)
        for key, value in found.items():
            click.echo(f"  {key}: {value if not isinstance(value, dict | list) else json.dumps(value)}")


@cli.command()
@click.argument("files", type=FILE, nargs=-1, required=True)
@click.option("--json", "as_json", is_flag=True, help="One JSON object instead of lines.")
def validate(files: tuple[Path, ...], as_json: bool) -> None:
    """Check files against their specifications; exit code 2 where there are errors."""
    from dataclasses import asdict

    from exporters.validate import validate as check

    findings = {str(path): check(path) for path in files}
    if as_json:
        click.echo(json.dumps({path: [asdict(f) for f in found] for path, found in findings.items()}, indent=2))
    else:
        for path, found in findings.items():
            errors = sum(f.severity == "error" for f in found)
            warnings = sum(f.severity == "warning" for f in found)
            click.echo(f"{path}: {errors} errors, {warnings} warnings")
            for f in found:
                click.echo(f"  {f.severity}: {f.code}: {f.message} [{f.where}]")
    if any(f.severity == "error" for found in findings.values() for f in found):
        raise SystemExit(2)


parse_cli.add_to(cli)
render_cli.add_to(cli)
view_cli.add_to(cli)
batch_cli.add_to(cli, make)
tileset_cli.add_to(cli)
annotate_cli.add_to(cli)
globe_cli.add_to(cli)
data_cli.add_to(cli)
training_cli.add_to(cli)
cli.add_command(tradeoff)
cli.add_command(doctor)


def main(arguments: list[str] | None = None) -> int:
    """Run the command line and return its exit code: 0 done, 2 bad usage or input, 1 a fault of ours."""
    from georef.errors import InputError

    words = sys.argv[1:] if arguments is None else arguments
    try:
        result = cli.main(words, prog_name="fig2mesh", standalone_mode=False)
        return result if isinstance(result, int) else 0
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message(), err=True)
        return 2
    except click.ClickException as error:
        message = " ".join(error.format_message().split())
        click.echo(f"fig2mesh: {message.rstrip('.')}; see fig2mesh --help", err=True)
        return 2
    except InputError as error:
        click.echo("fig2mesh: " + " ".join(str(error).split()), err=True)
        return 2
    except OSError as error:
        # Paths fail in more ways than can be listed: names too long, loops of links, folders that are files.
        where = str(error.filename or "a file")
        shown = where if len(where) < 200 else f"{where[:80]}…{where[-80:]}"
        click.echo(f"fig2mesh: {shown}: {error.strerror or 'cannot be used'}; check the path", err=True)
        return 2
    except (KeyboardInterrupt, click.Abort):
        click.echo("fig2mesh: interrupted; no output is half-written", err=True)
        return 130
    except SystemExit as error:
        return error.code if isinstance(error.code, int) else 1
    except Exception as error:
        if "-vv" in words or words.count("-v") > 1:
            raise
        click.echo(f"fig2mesh: internal error: {type(error).__name__}: {error} (-vv shows where)", err=True)
        return 1


if __name__ == "__main__":
    raise SystemExit(main())
