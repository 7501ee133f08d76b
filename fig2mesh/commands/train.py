"""`fig2mesh train`: one command per network; nothing heavy is imported before a command runs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from fig2mesh.errors import InputError
from fig2mesh.skeleton import KINDS
from fig2mesh.training.networks.schedule import Schedule

if TYPE_CHECKING:
    from fig2mesh.training.bodies.pack import Pack

VARIANTS = ("one-stream", "one-stream-pose", "two-stream", "two-stream-pose")
"""Names of `fig2mesh.nets.disn.VARIANTS`, repeated here because that module imports torch."""

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
"""Minutes per network without --budget and --epochs: hours for everything on two cores."""

FOLDER = click.Path(path_type=Path, file_okay=False)

STEPS = "Thousands of steps, instead of minutes."
"""Help of --epochs, where they have no other meaning."""


@dataclass(frozen=True)
class TrainingRun:
    """Options that all commands share; `rate` and `init` are None in commands without --lr and --init."""

    data: Path
    out: Path
    budget: float | None
    epochs: int | None
    seed: int
    device: str
    rate: float | None = None
    init: Path | None = None

    def minutes(self, network: str) -> float | None:
        """Budget of a network in minutes; None where --epochs alone limits it."""
        return BUDGET_MIN[network] if self.budget is None and self.epochs is None else self.budget

    def schedule(self, network: str) -> Schedule:
        """Schedule of a network for which an epoch is a thousand steps."""
        steps = None if self.epochs is None else 1000 * self.epochs
        device = _device(self.device)
        return Schedule(self.minutes(network), steps, self.seed, rate=self.rate, device=device, init=self.init)

    def cpu_schedule(self, network: str) -> Schedule:
        """Schedule of a network that is trained on the CPU only."""
        if self.device == "cuda":
            raise InputError("--device cuda", "this network is trained on the CPU", "omit the option")
        steps = None if self.epochs is None else 1000 * self.epochs
        return Schedule(self.minutes(network), steps, self.seed, rate=self.rate, init=self.init)


def common(
    data: str, epochs: str = STEPS, rate: float | None = None, init: str | None = None
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Add the options of `TrainingRun`, and pass them to the command as one.

    data, epochs, init : help of these options; rate : default of --lr. No rate, no --lr; no init, no --init.
    """
    options = [
        click.option("--data", type=click.Path(path_type=Path), required=True, metavar="PATH", help=data),
        click.option("--budget", type=click.FloatRange(0, min_open=True), metavar="MIN", help="Minutes per network."),
        click.option("--epochs", type=click.IntRange(1), metavar="N", help=epochs),
        click.option("--seed", type=click.IntRange(0, 2**31 - 1), default=0, show_default=True),
        click.option("--device", type=click.Choice(["auto", "cpu", "cuda"]), default="auto", show_default=True),
        click.option(
            "-o",
            "--output",
            "out",
            type=FOLDER,
            required=True,
            metavar="OUT",
            help="Folder for weights, logs and checkpoints; an interrupted run resumes there.",
        ),
    ]
    if rate is not None:
        options.append(
            click.option(
                "--lr",
                "rate",
                type=click.FloatRange(0, min_open=True),
                default=rate,
                show_default=True,
                help="Learning rate.",
            )
        )
    if init is not None:
        options.append(click.option("--init", type=FOLDER, metavar="DIR", help=init))

    def add(command: Callable[..., None]) -> Callable[..., None]:
        @wraps(command)
        def run(data: Path, out: Path, budget: float | None, epochs: int | None, **given: Any) -> None:
            shared = {name: given.pop(name) for name in ("seed", "device", "rate", "init") if name in given}
            command(TrainingRun(data, out, budget, epochs, **shared), **given)

        result: Callable[..., None] = run
        for option in reversed(options):
            result = option(result)
        return result

    return add


def kinds(command: Callable[..., None]) -> Callable[..., None]:
    """Add the option --kind."""
    option = click.option("--kind", "chosen", type=click.Choice(KINDS), multiple=True, help="Repeatable; default: all.")
    return option(command)


@click.group()
def train() -> None:
    """Train the networks; each command resumes from the checkpoint in OUT."""


@train.command()
@common("The pack, or the folder that holds pack.npz.", epochs="Passes of 100,000 figures, instead of minutes.")
@click.option("--joints", type=click.Choice(["16", "21"]), default="21", show_default=True)
@click.option("--perspective", is_flag=True, help="Perspective drawings: predict x and y too.")
@click.option("--visibility", is_flag=True, help="The visibility of joints is an input.")
@click.option("--limbs/--no-limbs", default=True, show_default=True, help="The foreshortening of limbs is an input.")
@click.option("--dropout", type=click.FloatRange(0, 0.9), default=0.1, show_default=True, help="The paper: 0.5.")
@click.option("--metric", is_flag=True, help="Trust the drawing's units, as the paper does.")
@click.option("--plain", is_flag=True, help="Undistorted bodies from all around: the paper's protocol.")
@click.option("--batch", type=click.IntRange(2), default=512, show_default=True, metavar="N")
def pose(run: TrainingRun, **given: Any) -> None:
    """Train the depths of joints (table 1)."""
    from fig2mesh.nets.pose_lift import PoseLiftShape
    from fig2mesh.training.networks.train_pose import pack_skeletons, train_pose

    shape = PoseLiftShape(
        int(given["joints"]), given["perspective"], given["visibility"], given["limbs"], given["metric"]
    )
    known, held = pack_skeletons(_pack(run.data))
    _, scores = train_pose(
        known,
        held,
        run.out,
        Schedule(
            budget_min=run.minutes("pose"),
            steps=None if run.epochs is None else run.epochs * 100_000 // given["batch"],
            seed=run.seed,
            batch=given["batch"],
            device=_device(run.device),
        ),
        shape=shape,
        augment=not given["plain"],
        dropout=given["dropout"],
    )
    _print_scores({name: value for name, value in scores.items() if "_mean_" not in name})


@train.command()
@common("Folder of shards.")
@kinds
def size(run: TrainingRun, chosen: tuple[str, ...]) -> None:
    """Train the sizes of parts."""
    from fig2mesh.training.networks.train_size import train_size

    for kind in chosen or KINDS:
        click.echo(f"{kind}:")
        _, scores = train_size(run.data, kind, run.out / f"size-{kind}", run.schedule("size"))
        _print_scores(scores)


@train.command()
@common(
    "Folder of shards.",
    epochs="Passes over all parts in all views.",
    rate=2e-3,
    init="Start from the weights of an earlier run in DIR/disn-….",
)
@kinds
@click.option("--variant", type=click.Choice(VARIANTS), default="two-stream-pose", show_default=True)
def parts(run: TrainingRun, chosen: tuple[str, ...], variant: str) -> None:
    """Train the shapes of parts (tables 2 and 3)."""
    from fig2mesh.nets.disn import DisnShape
    from fig2mesh.training.networks.train_parts import train_parts

    for kind in chosen or KINDS:
        click.echo(f"{kind}, {variant}:")
        scores = train_parts(
            run.data,
            kind,
            DisnShape.of(kind, variant),
            run.out / f"disn-{kind}-{variant}",
            Schedule(
                budget_min=run.minutes("parts"),
                seed=run.seed,
                rate=run.rate,
                device=_device(run.device),
                init=None if run.init is None else run.init / f"disn-{kind}-{variant}",
            ),
            epochs=run.epochs,
        )
        _print_scores(scores)


@train.command()
@common("Folder of shards with pictures.", rate=2e-3, init="Start from the weights of an earlier run.")
@click.option("--masks/--no-masks", default=True, show_default=True, help="Part masks are an input.")
def uv(run: TrainingRun, masks: bool) -> None:
    """Train texture coordinates (table 4)."""
    from fig2mesh.nets.uv_unet import UvUnetShape
    from fig2mesh.training.networks.train_uv import train_uv

    _print_scores(train_uv(run.data, run.out, run.schedule("uv"), UvUnetShape(masks)))


@train.command()
@common("Folder of shards with pictures.")
def fill(run: TrainingRun) -> None:
    """Train the positions from which unseen texels take their colours."""
    from fig2mesh.training.networks.train_fill import train_fill

    _print_scores(train_fill(run.data, run.out, run.schedule("fill")))


def with_fill(command: Callable[..., None]) -> Callable[..., None]:
    """Add the option --fill."""
    return click.option("--fill", type=FOLDER, required=True, metavar="DIR", help="Output of `train fill`.")(command)


@train.command()
@common("Folder of shards with pictures.")
@with_fill
def refine(run: TrainingRun, fill: Path) -> None:
    """Train the details of unseen sides."""
    from fig2mesh.training.networks.train_refine import train_refine

    _print_scores(train_refine(run.data, fill, run.out, run.cpu_schedule("refine")))


@train.command()
@common("Folder of shards with pictures.")
@with_fill
def head(run: TrainingRun, fill: Path) -> None:
    """Train the heads of unseen sides."""
    from fig2mesh.training.networks.train_refine import train_head

    _print_scores(train_head(run.data, fill, run.out, run.cpu_schedule("head")))


@train.command()
@common("Folder of crops.", rate=1e-3, init="Start from the weights of an earlier run.")
@click.option(
    "--blazepose",
    type=click.Path(path_type=Path, exists=True, dir_okay=False),
    metavar="TFLITE",
    help="Start the encoder from pose_landmark_full.tflite; for its source see docs/parsing.md.",
)
@click.option("--whole", is_flag=True, help="Train the encoder's first stages too.")
def parse(run: TrainingRun, blazepose: Path | None, whole: bool) -> None:
    """Train silhouette, parts and joints from a bare picture."""
    from fig2mesh.training.networks.train_parse import train_parse

    _print_scores(train_parse(run.data, run.out, run.cpu_schedule("parse"), blazepose=blazepose, whole=whole))


def _device(name: str) -> str:
    import torch

    if name == "cuda" and not torch.cuda.is_available():
        raise InputError("--device cuda", "no CUDA device found", "use --device cpu")
    if name == "auto":
        return "cuda" if torch.cuda.is_available() else "cpu"
    return name


def _pack(data: Path) -> Pack:
    from fig2mesh.training.bodies.pack import load_pack

    return load_pack(data / "pack.npz" if data.is_dir() else data)


def _print_scores(scores: dict[str, float]) -> None:
    for name, value in scores.items():
        click.echo(f"  {name}: {value:.4g}")
