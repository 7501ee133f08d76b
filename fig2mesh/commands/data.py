"""`fig2mesh data`: make and look at training data; nothing heavy is imported before a command runs."""

from __future__ import annotations

from pathlib import Path

import click

FILE = click.Path(path_type=Path, dir_okay=False)
FOLDER = click.Path(path_type=Path, file_okay=False)


@click.group()
def data() -> None:
    """Make training data: a pack of bodies and poses first, then samples from it."""


@data.command()
@click.option("--assets", type=FOLDER, metavar="DIR", help="Clips, clothes, characters; see docs/training.md.")
@click.option("--poses", type=click.IntRange(10, 100_000), default=3000, show_default=True, metavar="N")
@click.option("--seed", type=click.IntRange(0, 2**31 - 1), default=0, show_default=True)
@click.option("-o", "--output", "out", type=FILE, required=True, metavar="FILE", help="An .npz file.")
@click.option("--overwrite", is_flag=True, help="Replace an existing pack.")
def pack(assets: Path | None, poses: int, seed: int, out: Path, overwrite: bool) -> None:
    """Bodies, garments and poses in one file, from which samples need only NumPy and torch."""
    from fig2mesh.errors import InputError, OutputError
    from fig2mesh.training.bodies.pack import build_pack, save_pack

    if assets is not None and not assets.is_dir():
        raise InputError("--assets", f"no folder {assets}", "name the folder that holds the assets, or leave it out")
    if out.exists() and not overwrite:
        raise OutputError(out, "exists", "pass --overwrite or another file")
    made = build_pack(assets, seed, poses)
    save_pack(made, out)
    click.echo(
        f"{out}: {len(made.training_poses.clip)} poses and {len(made.held_out_poses.clip)} held out, "
        f"{len(made.garments)} garments, {len(made.characters)} characters",
        err=True,
    )


@data.command()
@click.option("--pack", type=FILE, required=True, metavar="FILE", help="What `data pack` made.")
@click.option(
    "-o", "--output", "out", type=FOLDER, required=True, metavar="DIR", help="Of shards; goes on with what is there."
)
@click.option("--bodies", type=click.IntRange(1), default=2000, show_default=True, metavar="N", help="To train on.")
@click.option(
    "--valid", type=click.IntRange(0), default=48, show_default=True, metavar="N", help="Each held-out split."
)
@click.option("--pictures/--no-pictures", default=True, show_default=True, help="Drawn pictures, labels, depth, UV.")
@click.option("--shapes/--no-shapes", default=True, show_default=True, help="Masks and distances of the parts.")
@click.option("--seed", type=click.IntRange(0, 2000), default=0, show_default=True)
@click.option("--jobs", type=click.IntRange(1, 64), default=1, show_default=True, metavar="N")
def build(pack: Path, out: Path, bodies: int, valid: int, pictures: bool, shapes: bool, seed: int, jobs: int) -> None:
    """Samples from a pack: parts, distances, masks, joints and pictures from four sides."""
    from fig2mesh.training.samples.build import BuildOptions
    from fig2mesh.training.samples.build import build as run

    run(
        pack,
        out,
        BuildOptions(bodies, valid, seed, pictures, shapes),
        jobs=jobs,
        report=lambda done, total: click.echo(f"{done} of {total} shards", err=True),
    )


@data.command()
@click.option("--pack", type=FILE, required=True, metavar="FILE", help="What `data pack` made.")
@click.option(
    "-o", "--output", "out", type=FOLDER, required=True, metavar="DIR", help="Of shards; goes on with what is there."
)
@click.option(
    "--bodies", type=click.IntRange(1), default=2000, show_default=True, metavar="N", help="Four drawings each."
)
@click.option(
    "--doodles", type=click.IntRange(1), default=3200, show_default=True, metavar="N", help="Lines and blobs."
)
@click.option("--valid", type=click.IntRange(1), default=40, show_default=True, metavar="N", help="Held-out bodies.")
@click.option("--seed", type=click.IntRange(0, 2000), default=0, show_default=True)
@click.option("--jobs", type=click.IntRange(1, 64), default=1, show_default=True, metavar="N")
def crops(pack: Path, out: Path, bodies: int, doodles: int, valid: int, seed: int, jobs: int) -> None:
    """Drawn figures with labels and joints for the figure parser."""
    from fig2mesh.training.samples.crop_data import build_crops

    build_crops(
        pack,
        out,
        bodies=bodies,
        doodles=doodles,
        valid=valid,
        seed=seed,
        jobs=jobs,
        report=lambda done, total: click.echo(f"{done} of {total} shards", err=True),
    )


@data.command()
@click.argument("source", type=click.Path(path_type=Path), metavar="DATA")
@click.option("-o", "--output", "out", type=FILE, required=True, metavar="PNG")
@click.option("--count", type=click.IntRange(1, 200), default=24, show_default=True, metavar="N", help="Bodies shown.")
@click.option("--overwrite", is_flag=True, help="Replace an existing file.")
def show(source: Path, out: Path, count: int, overwrite: bool) -> None:
    """A contact sheet of samples."""
    from fig2mesh.errors import OutputError

    if out.exists() and not overwrite:
        raise OutputError(out, "exists", "pass --overwrite or another file")
    from fig2mesh.training.samples.contact_sheet import make_sheet

    make_sheet(source, out, count)
