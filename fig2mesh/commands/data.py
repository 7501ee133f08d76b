"""`fig2mesh data`: make and inspect training data; heavy imports wait until a command runs."""

from __future__ import annotations

from pathlib import Path

import click

FILE = click.Path(path_type=Path, dir_okay=False)
FOLDER = click.Path(path_type=Path, file_okay=False)

PACK = "Pack written by `data pack`."
SHARDS = "Output folder for shards; an interrupted run resumes there."
SEED = "Seed of all random choices."
JOBS = "Number of worker processes."


@click.group()
def data() -> None:
    """Make training data: first a pack of bodies and poses, then samples from it."""


@data.command()
@click.option(
    "--assets", type=FOLDER, metavar="DIR", help="Folder of clips, clothes and characters; see docs/training.md."
)
@click.option(
    "--poses", type=click.IntRange(10, 100_000), default=3000, show_default=True, metavar="N", help="Number of poses."
)
@click.option("--seed", type=click.IntRange(0, 2**31 - 1), default=0, show_default=True, metavar="N", help=SEED)
@click.option("-o", "--output", "out", type=FILE, required=True, metavar="FILE", help="Output file, .npz.")
@click.option("--overwrite", is_flag=True, help="Replace an existing pack.")
def pack(assets: Path | None, poses: int, seed: int, out: Path, overwrite: bool) -> None:
    """Pack bodies, garments and poses into one file, from which samples are made with NumPy and torch alone."""
    from fig2mesh.errors import InputError, OutputError
    from fig2mesh.training.bodies.pack import build_pack, save_pack

    if assets is not None and not assets.is_dir():
        raise InputError("--assets", f"no such directory {assets}", "name the folder of the assets, or leave it out")
    if out.exists() and not overwrite:
        raise OutputError(out, "already exists", "use --overwrite or choose another name")
    made = build_pack(assets, seed, poses)
    save_pack(made, out)
    click.echo(
        f"{out}: {len(made.training_poses.clip)} poses and {len(made.held_out_poses.clip)} held out, "
        f"{len(made.garments)} garments, {len(made.characters)} characters",
        err=True,
    )


@data.command()
@click.option("--pack", type=FILE, required=True, metavar="FILE", help=PACK)
@click.option("-o", "--output", "out", type=FOLDER, required=True, metavar="DIR", help=SHARDS)
@click.option(
    "--bodies", type=click.IntRange(1), default=2000, show_default=True, metavar="N", help="Number of training bodies."
)
@click.option(
    "--valid",
    type=click.IntRange(0),
    default=48,
    show_default=True,
    metavar="N",
    help="Number of bodies in each validation set.",
)
@click.option(
    "--pictures/--no-pictures", default=True, show_default=True, help="Include drawn pictures, labels, depth and UV."
)
@click.option("--shapes/--no-shapes", default=True, show_default=True, help="Include masks and distances of the parts.")
@click.option("--seed", type=click.IntRange(0, 2000), default=0, show_default=True, metavar="N", help=SEED)
@click.option("--jobs", type=click.IntRange(1, 64), default=1, show_default=True, metavar="N", help=JOBS)
def build(pack: Path, out: Path, bodies: int, valid: int, pictures: bool, shapes: bool, seed: int, jobs: int) -> None:
    """Make samples from a pack: parts, distances, masks, joints and pictures from four sides."""
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
@click.option("--pack", type=FILE, required=True, metavar="FILE", help=PACK)
@click.option("-o", "--output", "out", type=FOLDER, required=True, metavar="DIR", help=SHARDS)
@click.option(
    "--bodies",
    type=click.IntRange(1),
    default=2000,
    show_default=True,
    metavar="N",
    help="Number of training bodies, of four drawings each.",
)
@click.option(
    "--doodles",
    type=click.IntRange(1),
    default=3200,
    show_default=True,
    metavar="N",
    help="Number of figures made of lines and blobs.",
)
@click.option(
    "--valid", type=click.IntRange(1), default=40, show_default=True, metavar="N", help="Number of validation bodies."
)
@click.option("--seed", type=click.IntRange(0, 2000), default=0, show_default=True, metavar="N", help=SEED)
@click.option("--jobs", type=click.IntRange(1, 64), default=1, show_default=True, metavar="N", help=JOBS)
def crops(pack: Path, out: Path, bodies: int, doodles: int, valid: int, seed: int, jobs: int) -> None:
    """Make drawn figures with labels and joints, to train the figure parser."""
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
@click.option("-o", "--output", "out", type=FILE, required=True, metavar="PNG", help="Output file.")
@click.option(
    "--count", type=click.IntRange(1, 200), default=24, show_default=True, metavar="N", help="Number of bodies."
)
@click.option("--overwrite", is_flag=True, help="Replace an existing file.")
def show(source: Path, out: Path, count: int, overwrite: bool) -> None:
    """Make a contact sheet of samples."""
    from fig2mesh.errors import OutputError

    if out.exists() and not overwrite:
        raise OutputError(out, "already exists", "use --overwrite or choose another name")
    from fig2mesh.training.samples.contact_sheet import make_sheet

    make_sheet(source, out, count)
