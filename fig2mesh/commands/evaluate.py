"""`fig2mesh evaluate`: networks on held-out bodies, whole figures on drawings; nothing heavy is imported before."""

from __future__ import annotations

from pathlib import Path

import click

FILE = click.Path(path_type=Path, dir_okay=False)
FOLDER = click.Path(path_type=Path, file_okay=False)


@click.group()
def evaluate() -> None:
    """Measure how good the networks are, or the models of a folder of drawings."""


@evaluate.command()
@click.option("--pack", type=FILE, required=True, metavar="FILE", help="What `data pack` made.")
@click.option("--data", "source", type=FOLDER, required=True, metavar="DIR", help="What `data build` made.")
@click.option("--runs", type=FOLDER, metavar="DIR", help="What `train` made: networks that are not shipped.")
@click.option("--bodies", type=click.IntRange(1), default=32, show_default=True, metavar="N", help="Dense fields.")
@click.option("--figures", type=click.IntRange(1), default=12, show_default=True, metavar="N", help="Whole drawings.")
@click.option("-o", "--output", "out", type=FILE, metavar="FILE", help="Markdown; default: to stdout.")
@click.option("--overwrite", is_flag=True, help="Replace an existing file.")
def networks(
    pack: Path, source: Path, runs: Path | None, bodies: int, figures: int, out: Path | None, overwrite: bool
) -> None:
    """The paper's tables beside ours, on clips and people that training never saw."""
    from fig2mesh.errors import InputError
    from fig2mesh.training.bodies.pack import load_pack
    from fig2mesh.training.evaluate.networks import Limits
    from fig2mesh.training.evaluate.networks import evaluate as measure

    if runs is not None and not runs.is_dir():
        raise InputError("--runs", f"no folder {runs}", "name the folder that train wrote to, or leave it out")
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
@click.option("--quality", type=click.Choice(["draft", "standard", "fine"]), default="standard", show_default=True)
@click.option(
    "--parts",
    type=click.Choice(["network", "outline"]),
    default="network",
    show_default=True,
    help="What depths come from: networks, or rules and the outline alone.",
)
@click.option("-o", "--output", "out", type=FILE, metavar="FILE", help="Default: to stdout.")
@click.option("--json", "json_", is_flag=True, help="Unrounded facts instead of a Markdown table.")
@click.option("--overwrite", is_flag=True, help="Replace an existing file.")
def figures(folder: Path, quality: str, parts: str, out: Path | None, json_: bool, overwrite: bool) -> None:
    """Make a model of every figure in DIR and measure it against its drawing and as a solid.

    DIR holds folders with image.png, keypoints.json and, where needed, mask.png, or pairs of NAME.png and NAME.json.
    A figure of which no model can be made has the reason in the table, and the exit code is 1.
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
@click.option("--data", "source", type=FOLDER, required=True, metavar="DIR", help="What `data build` made.")
@click.option("--runs", type=FOLDER, metavar="DIR", help="What `train` made: networks that are not shipped.")
@click.option("--bodies", type=click.IntRange(1), default=24, show_default=True, metavar="N", help="Each split.")
@click.option("-o", "--output", "out", type=FILE, metavar="FILE", help="Markdown; default: to stdout.")
@click.option("--overwrite", is_flag=True, help="Replace an existing file.")
def textures(source: Path, runs: Path | None, bodies: int, out: Path | None, overwrite: bool) -> None:
    """Texture coordinates (table 4) and unseen sides, on clips and people that training never saw."""
    from fig2mesh.training.evaluate.textures import evaluate_textures

    _check(() if out is None else (out,), overwrite)
    _write(evaluate_textures(source, runs, bodies, lambda line: click.echo(line, err=True)), out)


@evaluate.command()
@click.option("--figures", type=FOLDER, metavar="DIR", help="Folders with image.png, mask.png, keypoints.json.")
@click.option("--data", "source", type=FOLDER, metavar="DIR", help="What `data crops` made: its held-out crops.")
@click.option("--count", type=click.IntRange(1), default=160, show_default=True, metavar="N", help="Crops of a split.")
@click.option("--blazepose", type=FILE, metavar="TFLITE", help="Score pose_landmark_heavy.tflite on the crops too.")
@click.option("-o", "--output", "out", type=FILE, metavar="FILE", help="Markdown; default: to stdout.")
@click.option("--overwrite", is_flag=True, help="Replace an existing file.")
def parse(
    figures: Path | None, source: Path | None, count: int, blazepose: Path | None, out: Path | None, overwrite: bool
) -> None:
    """Silhouettes and joints from bare pictures: annotated drawings, held-out crops, or both."""
    from fig2mesh.errors import InputError

    if figures is None and source is None:
        raise InputError("evaluate parse", "nothing to measure", "pass --figures DIR, --data DIR or both")
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
    """Refuse outputs before the work begins; make their folder."""
    from fig2mesh.errors import OutputError

    for path in paths:
        if path.exists() and not overwrite:
            raise OutputError(path, "exists", "pass --overwrite or another file")
    for path in paths:
        path.parent.mkdir(parents=True, exist_ok=True)


def _write(text: str, out: Path | None) -> None:
    """To a file, whole or not at all; to stdout where there is none."""
    if out is None:
        click.echo(text, nl=False)
        return
    from exporters.atomic_file import write_text

    write_text(out, text)
