"""`fig2mesh evaluate`: networks on held-out bodies, models of drawings; heavy imports wait until a command runs."""

from __future__ import annotations

from pathlib import Path
from typing import get_args

import click

from fig2mesh.settings import Contours, Textures

FILE = click.Path(path_type=Path, dir_okay=False)
FOLDER = click.Path(path_type=Path, file_okay=False)

SAMPLES = "Folder written by `data build`."
RUNS = "Folder written by `train`, for networks that are not shipped."
QUALITY = "Preset for the resolution of all stages."
MARKDOWN = "Output file, Markdown. Default: stdout."


@click.group()
def evaluate() -> None:
    """Measure the accuracy of the networks, or of the models of a folder of drawings."""


@evaluate.command()
@click.option("--pack", type=FILE, required=True, metavar="FILE", help="Pack written by `data pack`.")
@click.option("--data", "source", type=FOLDER, required=True, metavar="DIR", help=SAMPLES)
@click.option("--runs", type=FOLDER, metavar="DIR", help=RUNS)
@click.option(
    "--bodies",
    type=click.IntRange(1),
    default=32,
    show_default=True,
    metavar="N",
    help="Number of bodies with dense fields.",
)
@click.option(
    "--figures",
    type=click.IntRange(1),
    default=12,
    show_default=True,
    metavar="N",
    help="Number of whole drawings.",
)
@click.option("-o", "--output", "out", type=FILE, metavar="FILE", help=MARKDOWN)
@click.option("--overwrite", is_flag=True, help="Replace an existing file.")
def networks(
    pack: Path, source: Path, runs: Path | None, bodies: int, figures: int, out: Path | None, overwrite: bool
) -> None:
    """Compare the networks with the paper's tables, on clips and people held out of training."""
    from fig2mesh.errors import InputError
    from fig2mesh.training.bodies.pack import load_pack
    from fig2mesh.training.evaluate.networks import Limits
    from fig2mesh.training.evaluate.networks import evaluate as measure

    if runs is not None and not runs.is_dir():
        raise InputError("--runs", f"no such directory {runs}", "name the folder written by train, or leave it out")
    _check(() if out is None else (out, out.with_suffix(".png")), overwrite)
    report = measure(load_pack(pack), source, runs, Limits(bodies, figures), lambda line: click.echo(line, err=True))
    if out is not None and runs is not None:
        from fig2mesh.training.evaluate.curves import plot_runs

        curves = out.with_suffix(".png")
        if plot_runs(runs, curves):
            report += f"\n## Learning curves\n\n![Scores on held-out bodies while training]({curves.name})\n"
    _write(report, out)


@evaluate.command()
@click.argument("folder", type=FOLDER, metavar="DIR")
@click.option(
    "--quality", type=click.Choice(["draft", "standard", "fine"]), default="standard", show_default=True, help=QUALITY
)
@click.option(
    "--parts",
    type=click.Choice(["network", "outline"]),
    default="network",
    show_default=True,
    help="Method for the shapes of parts: neural networks, or the outline and rules alone.",
)
@click.option("-o", "--output", "out", type=FILE, metavar="FILE", help="Output file. Default: stdout.")
@click.option("--json", "json_", is_flag=True, help="Write unrounded values as JSON instead of a Markdown table.")
@click.option("--overwrite", is_flag=True, help="Replace an existing file.")
def figures(folder: Path, quality: str, parts: str, out: Path | None, json_: bool, overwrite: bool) -> None:
    """Make a model of every figure in DIR; measure its likeness to the drawing and its quality as a solid.

    DIR contains folders with image.png, keypoints.json and, where needed, mask.png; or pairs of NAME.png and
    NAME.json. If no model can be made of a figure, the table gives the reason, and the exit code is 1.
    """
    from fig2mesh.evaluate.figures import as_json, as_markdown, evaluate_figures, find_drawings
    from fig2mesh.settings import settings_for

    settings = settings_for(quality, parts=parts)  # type: ignore[arg-type]
    drawings = find_drawings(folder)
    _check(() if out is None else (out,), overwrite)
    rows = evaluate_figures(drawings, settings, lambda line: click.echo(line, err=True))
    _write((as_json if json_ else as_markdown)(rows), out)
    if any(row.failure for row in rows):
        raise SystemExit(1)


@evaluate.command()
@click.option("--data", "source", type=FOLDER, required=True, metavar="DIR", help=SAMPLES)
@click.option("--runs", type=FOLDER, metavar="DIR", help=RUNS)
@click.option(
    "--bodies",
    type=click.IntRange(1),
    default=24,
    show_default=True,
    metavar="N",
    help="Number of bodies of each validation set.",
)
@click.option("-o", "--output", "out", type=FILE, metavar="FILE", help=MARKDOWN)
@click.option("--overwrite", is_flag=True, help="Replace an existing file.")
def textures(source: Path, runs: Path | None, bodies: int, out: Path | None, overwrite: bool) -> None:
    """Measure texture coordinates (table 4) and unseen sides, on clips and people held out of training."""
    from fig2mesh.training.evaluate.textures import evaluate_textures

    _check(() if out is None else (out,), overwrite)
    _write(evaluate_textures(source, runs, bodies, lambda line: click.echo(line, err=True)), out)


@evaluate.command()
@click.option("--pack", type=FILE, required=True, metavar="FILE", help="Pack written by `data pack`.")
@click.option(
    "--set",
    "name",
    type=click.Choice(["tuning", "test"]),
    default="test",
    show_default=True,
    help="16 figures to try things out on, or 64 others of other people in other clothes.",
)
@click.option(
    "--quality", type=click.Choice(["draft", "standard", "fine"]), default="draft", show_default=True, help=QUALITY
)
@click.option("--textures", type=click.Choice(get_args(Textures)), help="Colours of unseen sides, as for a conversion.")
@click.option("--contours", type=click.Choice(get_args(Contours)), help="Form of the contour, as for a conversion.")
@click.option("--models", type=FOLDER, metavar="DIR", help="Measure DIR/NAME.glb instead of converting the figures.")
@click.option("--write", "drawings", type=FOLDER, metavar="DIR", help="Only write the figures, with their true backs.")
@click.option("--count", type=click.IntRange(1), metavar="N", help="Number of figures, if not all.")
@click.option("-o", "--output", "out", type=FILE, metavar="FILE", help="Output file. Default: stdout.")
@click.option("--json", "json_", is_flag=True, help="Write the values of all figures as JSON instead of a summary.")
@click.option("--overwrite", is_flag=True, help="Replace an existing file.")
def backs(
    pack: Path,
    name: str,
    quality: str,
    textures: str | None,
    contours: str | None,
    models: Path | None,
    drawings: Path | None,
    count: int | None,
    out: Path | None,
    json_: bool,
    overwrite: bool,
) -> None:
    """Compare backs of models with the true backs of synthetic figures.

    Beside them stand the mirrored front and the nearest colour that the front shows.
    """
    from fig2mesh.errors import InputError
    from fig2mesh.evaluate.backs import as_json, as_markdown, evaluate_backs, write_figures
    from fig2mesh.settings import settings_for
    from fig2mesh.training.bodies.pack import load_pack

    if models is not None and not models.is_dir():
        raise InputError("--models", f"no such directory {models}", "name the folder of the models, or leave it out")
    _check(() if out is None else (out,), overwrite)
    if drawings is not None:
        write_figures(load_pack(pack), name, drawings, count)
        return
    settings = settings_for(quality, textures=textures, contours=contours)  # type: ignore[arg-type]
    rows, failures = evaluate_backs(
        load_pack(pack), name, settings, models=models, limit=count, report=lambda line: click.echo(line, err=True)
    )
    _write(as_json(rows, failures) if json_ else as_markdown(rows, failures, name, settings), out)
    if failures:
        raise SystemExit(1)


@evaluate.command()
@click.option("--figures", type=FOLDER, metavar="DIR", help="Folders with image.png, mask.png, keypoints.json.")
@click.option("--data", "source", type=FOLDER, metavar="DIR", help="Folder written by `data crops`.")
@click.option(
    "--count",
    type=click.IntRange(1),
    default=160,
    show_default=True,
    metavar="N",
    help="Number of crops of each validation set.",
)
@click.option("--blazepose", type=FILE, metavar="TFLITE", help="Also score pose_landmark_heavy.tflite on the crops.")
@click.option("-o", "--output", "out", type=FILE, metavar="FILE", help=MARKDOWN)
@click.option("--overwrite", is_flag=True, help="Replace an existing file.")
def parse(
    figures: Path | None, source: Path | None, count: int, blazepose: Path | None, out: Path | None, overwrite: bool
) -> None:
    """Measure silhouettes and joints inferred from annotated drawings, validation crops, or both."""
    from fig2mesh.errors import InputError

    if figures is None and source is None:
        raise InputError("evaluate parse", "nothing to measure", "give --figures DIR, --data DIR or both")
    _check(() if out is None else (out,), overwrite)
    text = ""
    if source is not None:
        from fig2mesh.training.evaluate.crops import evaluate_crops

        text += evaluate_crops(source, count, blazepose, lambda line: click.echo(line, err=True))
    if figures is not None:
        from fig2mesh.training.evaluate.parser import evaluate_parse

        text += evaluate_parse(figures, lambda line: click.echo(line, err=True))
    _write(text, out)


def _check(paths: tuple[Path, ...], overwrite: bool) -> None:
    """Raise OutputError for existing outputs, and make the folder of the others."""
    from fig2mesh.errors import OutputError

    for path in paths:
        if path.exists() and not overwrite:
            raise OutputError(path, "already exists", "use --overwrite or choose another name")
    for path in paths:
        path.parent.mkdir(parents=True, exist_ok=True)


def _write(text: str, out: Path | None) -> None:
    """Write a text to a file, whole or not at all, or to stdout."""
    if out is None:
        click.echo(text, nl=False)
        return
    from exporters.atomic_file import write_text

    write_text(out, text)
