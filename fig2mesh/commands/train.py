"""`fig2mesh train`: one command per network; heavy imports wait until a command runs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from fig2mesh.errors import InputError
from fig2mesh.skeleton import KINDS
from fig2mesh.training.networks.schedule import Schedule

if TYPE_CHECKING:
    from fig2mesh.training.bodies.pack import Pack


VARIANTS = ("one-stream", "one-stream-pose", "two-stream", "two-stream-pose")
"""Names of `fig2mesh.nets.disn.VARIANTS`, repeated because that module imports torch."""

BUDGET_MIN = {
    "pose": 60.0,
    "size": 3.0,
    "parts": 45.0,
    "uv": 40.0,
    "fill": 40.0,
    "refine": 40.0,
    "head": 20.0,
    "parse": 240.0,
}
"""Minutes per network where neither --budget nor --epochs is given: hours for everything on two cores."""

FOLDER = click.Path(path_type=Path, file_okay=False)

KIND = "Kind of part. Repeatable. Default: all."
DROPOUT = "Dropout probability; 0.5 in the paper."
VARIANT = "Variant of the network."


def common(data: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Decorator that adds the options of all commands; data : help of --data."""
    options = [
        click.option("--data", type=click.Path(path_type=Path), required=True, metavar="PATH", help=data),
        click.option("--budget", type=click.FloatRange(0, min_open=True), metavar="MIN", help="Minutes per network."),
        click.option(
            "--seed",
            type=click.IntRange(0, 2**31 - 1),
            default=0,
            show_default=True,
            metavar="N",
            help="Seed of all random choices.",
        ),
        click.option(
            "--device", type=click.Choice(["auto", "cpu", "cuda"]), default="auto", show_default=True, help="Device."
        ),
        click.option(
            "-o",
            "--output",
            "out",
            type=FOLDER,
            required=True,
            metavar="OUT",
            help="Output folder for weights, logs and checkpoints; an interrupted run resumes there.",
        ),
    ]

    def add(command: Callable[..., None]) -> Callable[..., None]:
        for option in reversed(options):
            command = option(command)
        return command

    return add


def kinds(command: Callable[..., None]) -> Callable[..., None]:
    """Decorator that adds the option --kind."""
    option = click.option("--kind", "chosen", type=click.Choice(KINDS), multiple=True, help=KIND)
    return option(command)


@click.group()
def train() -> None:
    """Train the networks. Each command resumes an interrupted run in OUT."""


@train.command()
@common("Pack, or folder that contains pack.npz.")
@click.option("--epochs", type=click.IntRange(1), metavar="N", help="Epochs of 100,000 figures, instead of --budget.")
@click.option("--joints", type=click.Choice(["16", "21"]), default="21", show_default=True, help="Number of joints.")
@click.option("--perspective", is_flag=True, help="Train on perspective drawings; also predict x and y.")
@click.option("--visibility", is_flag=True, help="Use the visibility of joints as an input.")
@click.option(
    "--limbs/--no-limbs", default=True, show_default=True, help="Use the foreshortening of limbs as an input."
)
@click.option("--dropout", type=click.FloatRange(0, 0.9), default=0.1, show_default=True, help=DROPOUT)
@click.option("--metric", is_flag=True, help="Use the units of the drawing, as the paper does.")
@click.option("--plain", is_flag=True, help="Train on unaugmented bodies from all sides, as the paper does.")
@click.option("--batch", type=click.IntRange(2), default=512, show_default=True, metavar="N", help="Batch size.")
def pose(data: Path, out: Path, budget: float | None, epochs: int | None, device: str, **given: Any) -> None:
    """Train the network for the depths of joints (table 1)."""
    from fig2mesh.nets.pose_lift import PoseLiftShape
    from fig2mesh.training.networks.train_pose import pack_skeletons, train_pose

    shape = PoseLiftShape(
        int(given["joints"]), given["perspective"], given["visibility"], given["limbs"], given["metric"]
    )
    known, held = pack_skeletons(_pack(data))
    _, scores = train_pose(
        known,
        held,
        out,
        Schedule(
            budget_min=_minutes("pose", budget, epochs),
            steps=None if epochs is None else epochs * 100_000 // given["batch"],
            seed=given["seed"],
            batch=given["batch"],
            device=_device(device),
        ),
        shape=shape,
        augment=not given["plain"],
        dropout=given["dropout"],
    )
    _print_scores({name: value for name, value in scores.items() if "_mean_" not in name})


@train.command()
@common("Folder of shards.")
@kinds
@click.option("--epochs", type=click.IntRange(1), metavar="N", help="Epochs of 1,000 steps, instead of --budget.")
def size(
    data: Path, out: Path, budget: float | None, epochs: int | None, device: str, chosen: tuple[str, ...], seed: int
) -> None:
    """Train the networks for the sizes of parts."""
    from fig2mesh.training.networks.train_size import train_size

    for kind in chosen or KINDS:
        click.echo(f"{kind}:")
        _, scores = train_size(
            data,
            kind,
            out / f"size-{kind}",
            _schedule("size", budget, epochs, seed, device=_device(device)),
        )
        _print_scores(scores)


@train.command()
@common("Folder of shards.")
@kinds
@click.option("--variant", type=click.Choice(VARIANTS), default="two-stream-pose", show_default=True, help=VARIANT)
@click.option(
    "--epochs", type=click.IntRange(1), metavar="N", help="Passes over each part in each view, instead of --budget."
)
@click.option("--lr", type=click.FloatRange(0, min_open=True), default=2e-3, show_default=True, help="Learning rate.")
@click.option("--init", type=FOLDER, metavar="DIR", help="Initialise with the weights of an earlier run in DIR/disn-….")
def parts(
    data: Path,
    out: Path,
    budget: float | None,
    epochs: int | None,
    device: str,
    chosen: tuple[str, ...],
    variant: str,
    seed: int,
    lr: float,
    init: Path | None,
) -> None:
    """Train the networks for the shapes of parts (tables 2 and 3)."""
    from fig2mesh.nets.disn import DisnShape
    from fig2mesh.training.networks.train_parts import train_parts

    for kind in chosen or KINDS:
        click.echo(f"{kind}, {variant}:")
        scores = train_parts(
            data,
            kind,
            DisnShape.of(kind, variant),
            out / f"disn-{kind}-{variant}",
            Schedule(
                budget_min=_minutes("parts", budget, epochs),
                seed=seed,
                rate=lr,
                device=_device(device),
                init=None if init is None else init / f"disn-{kind}-{variant}",
            ),
            epochs=epochs,
        )
        _print_scores(scores)


@train.command()
@common("Folder of shards with pictures.")
@click.option("--masks/--no-masks", default=True, show_default=True, help="Use part masks as an input.")
@click.option("--epochs", type=click.IntRange(1), metavar="N", help="Epochs of 1,000 steps, instead of --budget.")
@click.option("--lr", type=click.FloatRange(0, min_open=True), default=2e-3, show_default=True, help="Learning rate.")
@click.option("--init", type=FOLDER, metavar="DIR", help="Initialise with the weights of an earlier run.")
def uv(
    data: Path,
    out: Path,
    budget: float | None,
    epochs: int | None,
    device: str,
    seed: int,
    masks: bool,
    lr: float,
    init: Path | None,
) -> None:
    """Train the network for texture coordinates (table 4)."""
    from fig2mesh.nets.uv_unet import UvUnetShape
    from fig2mesh.training.networks.train_uv import train_uv

    schedule = _schedule("uv", budget, epochs, seed, rate=lr, device=_device(device), init=init)
    _print_scores(train_uv(data, out, schedule, UvUnetShape(masks)))


@train.command()
@common("Folder of shards with pictures.")
@click.option("--epochs", type=click.IntRange(1), metavar="N", help="Epochs of 1,000 steps, instead of --budget.")
def fill(data: Path, out: Path, budget: float | None, epochs: int | None, device: str, seed: int) -> None:
    """Train the network that chooses the source of each unseen texel's colour."""
    from fig2mesh.training.networks.train_fill import train_fill

    _print_scores(train_fill(data, out, _schedule("fill", budget, epochs, seed, device=_device(device))))


def filled(command: Callable[..., None]) -> Callable[..., None]:
    """Decorator that adds the option --fill."""
    return click.option("--fill", type=FOLDER, required=True, metavar="DIR", help="Output folder of `train fill`.")(
        command
    )


@train.command()
@common("Folder of shards with pictures.")
@filled
@click.option("--epochs", type=click.IntRange(1), metavar="N", help="Epochs of 1,000 steps, instead of --budget.")
def refine(data: Path, out: Path, budget: float | None, epochs: int | None, device: str, seed: int, fill: Path) -> None:
    """Train the network for details of unseen sides."""
    from fig2mesh.training.networks.train_refine import train_refine

    _check_cpu(device)
    _print_scores(train_refine(data, fill, out, _schedule("refine", budget, epochs, seed)))


@train.command()
@common("Folder of shards with pictures.")
@filled
@click.option("--epochs", type=click.IntRange(1), metavar="N", help="Epochs of 1,000 steps, instead of --budget.")
def head(data: Path, out: Path, budget: float | None, epochs: int | None, device: str, seed: int, fill: Path) -> None:
    """Train the network for unseen sides of heads."""
    from fig2mesh.training.networks.train_refine import train_head

    _check_cpu(device)
    _print_scores(train_head(data, fill, out, _schedule("head", budget, epochs, seed)))


@train.command()
@common("Folder of crops.")
@click.option("--epochs", type=click.IntRange(1), metavar="N", help="Epochs of 1,000 steps, instead of --budget.")
@click.option("--lr", type=click.FloatRange(0, min_open=True), default=1e-3, show_default=True, help="Learning rate.")
@click.option("--init", type=FOLDER, metavar="DIR", help="Initialise with the weights of an earlier run.")
@click.option(
    "--blazepose",
    type=click.Path(path_type=Path, exists=True, dir_okay=False),
    metavar="TFLITE",
    help="Initialise the encoder with pose_landmark_full.tflite; for its source see docs/parsing.md.",
)
@click.option("--whole", is_flag=True, help="Also train the first stages of the encoder.")
def parse(
    data: Path,
    out: Path,
    budget: float | None,
    epochs: int | None,
    device: str,
    seed: int,
    lr: float,
    init: Path | None,
    blazepose: Path | None,
    whole: bool,
) -> None:
    """Train the network that finds silhouette, parts and joints in a picture."""
    from fig2mesh.training.networks.train_parse import train_parse

    _check_cpu(device)
    schedule = _schedule("parse", budget, epochs, seed, rate=lr, init=init)
    _print_scores(train_parse(data, out, schedule, blazepose=blazepose, whole=whole))


def _schedule(network: str, budget: float | None, epochs: int | None, seed: int, **given: Any) -> Schedule:
    """Schedule of a network whose epochs are 1,000 steps; given : further fields."""
    steps = None if epochs is None else 1000 * epochs
    return Schedule(_minutes(network, budget, epochs), steps, seed, **given)


def _minutes(network: str, budget: float | None, epochs: int | None) -> float | None:
    return BUDGET_MIN[network] if budget is None and epochs is None else budget


def _device(name: str) -> str:
    import torch

    if name == "cuda" and not torch.cuda.is_available():
        raise InputError("--device cuda", "no CUDA device found", "use --device cpu")
    if name == "auto":
        return "cuda" if torch.cuda.is_available() else "cpu"
    return name


def _check_cpu(name: str) -> None:
    if name == "cuda":
        raise InputError("--device cuda", "this network is trained on the CPU", "leave it out")


def _pack(data: Path) -> Pack:
    from fig2mesh.training.bodies.pack import load_pack

    return load_pack(data / "pack.npz" if data.is_dir() else data)


def _print_scores(scores: dict[str, float]) -> None:
    for name, value in scores.items():
        click.echo(f"  {name}: {value:.4g}")
