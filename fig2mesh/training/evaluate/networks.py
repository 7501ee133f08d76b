"""The paper's tables beside ours, on held-out clips and people; and whole figures against ground truth.

Everything is measured here from weights and data; scores reported by training are not used.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from fig2mesh.nets.disn import PART_WEIGHTS, VARIANTS, Disn, DisnShape
from fig2mesh.nets.part_size import SIZE_WEIGHTS, SizeShape
from fig2mesh.nets.pose_lift import POSE_WEIGHTS, SHIPPED, PoseLift, PoseLiftShape
from fig2mesh.skeleton import BODY_PARTS, KINDS, PART_KIND
from fig2mesh.training.bodies.pack import Pack
from fig2mesh.training.evaluate.paper import PART_IOU, PART_RMSE, POSE_SCORES, VARIANT_SCORES

SPLITS: Final = ("valid-clips", "valid-characters")
SPLIT_TITLE: Final = {"valid-clips": "held-out clips", "valid-characters": "held-out characters"}

RULE_SAMPLES: Final = 600
"""Number of samples on which the rule without network is scored; it takes them one by one."""

Report = Callable[[str], None]


@dataclass(frozen=True)
class Limits:
    """Numbers of samples per split: bodies for dense fields, figures for whole drawings."""

    bodies: int = 32
    figures: int = 12


def evaluate(
    pack: Pack, data: Path, runs: Path | None, limits: Limits = Limits(), report: Report = lambda line: None
) -> str:
    """Return the report as Markdown.

    data : shards; runs : folder of trained runs besides the shipped weights, searched for networks of tables 1 and 2
    """
    sections = [
        "# Evaluation",
        "Written by `fig2mesh evaluate networks`; [training.md](training.md) describes data and training. "
        f"Part fields: {limits.bodies} bodies of each held-out split, each part from one of four sides, by turns; "
        f"whole figures: {limits.figures} of each.",
    ]
    made: tuple[tuple[str, Callable[[], str]], ...] = (
        ("Table 1: pose", lambda: _pose_table(pack, runs)),
        ("Table 2: variants of the part network, hands", lambda: _variant_table(data, runs, limits.bodies)),
        ("Table 3: parts", lambda: _part_tables(data, limits.bodies)),
        ("Part sizes", lambda: _size_table(data)),
        ("Whole figures", lambda: _figure_table(pack, limits.figures)),
    )
    for title, make in made:
        report(title)
        sections += [f"## {title}", make()]
    return "\n\n".join(sections) + "\n"


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table; the first column is text, the others numbers."""
    line = "|" + "|".join(["---", *["---:"] * (len(head) - 1)]) + "|"
    lines = ["| " + " | ".join(row) + " |" for row in (head, *rows)]
    return "\n".join([lines[0], line, *lines[1:]])


def _pose_table(pack: Pack, runs: Path | None) -> str:
    import torch

    from fig2mesh.training.bodies.skeletons import Sampler
    from fig2mesh.training.networks.train_pose import COUNT, VIEWS, pack_skeletons, pose_scores

    _, held = pack_skeletons(pack)
    sampler = Sampler(held)

    def sample(view: str, perspective: bool) -> Any:
        chosen = replace(VIEWS[view], perspective=perspective)
        return sampler.draw(COUNT, chosen, torch.Generator().manual_seed(1))

    rows = []
    for joints in (16, 21):
        for perspective in (True, False):
            theirs = POSE_SCORES[joints, perspective]
            name = f"{joints} joints, {'perspective' if perspective else 'orthographic'}"
            found = _pose_network(runs, PoseLiftShape(joints, perspective, limbs=True, metric=True))
            ours = ("not trained", "")
            if found is not None:
                ours = _pose_cells(pose_scores(found, sample("sides", perspective)))
            rows.append((name, f"{theirs[0]:.2f}", f"{theirs[1]:.2f}", *ours))
    head = ("four sides, scale known", "paper RMSE mm", "paper PCK150 %", "RMSE mm", "PCK150 %")
    first = table(head, rows)
    shipped = POSE_WEIGHTS.shipped(SHIPPED)
    rows = []
    for view, title in (("sides", "four sides"), ("around", "any side"), ("drawn", "as drawings are")):
        one = sample(view, False)
        rows.append((title, *_pose_cells(pose_scores(shipped, one)), *_pose_cells(_rule_scores(one))))
    head = ("shipped network, 21 joints, any scale", "RMSE mm", "PCK150 %", "rule without network RMSE mm", "PCK150 %")
    second = table(head, rows)
    text = (
        "RMSE is the square root of the mean squared 3D distance over joints and samples, PCK150 the share of joints "
        f"within 150 mm; {COUNT} pairs of a held-out pose and a held-out body that stands 1.79 m. The shipped network "
        "does not know the scale of a drawing; those of the first table do, as the paper's. All have the paper's "
        "layers, with our inputs (how foreshortened limbs are) and less dropout. The rule is scored on 600. "
        "As drawings are: disproportionate limbs and heads, joints a little off, hidden ones guessed."
    )
    return f"{text}\n\n{first}\n\n{second}"


def _pose_cells(scores: dict[str, float]) -> tuple[str, str]:
    return f"{scores['rmse_mm']:.1f}", f"{scores['pck150']:.1f}"


def _pose_network(runs: Path | None, shape: PoseLiftShape) -> PoseLift | None:
    found = sorted(runs.rglob(POSE_WEIGHTS.path(shape).name)) if runs is not None else []
    return POSE_WEIGHTS.read(found[0])[0] if found else None


def _rule_scores(sample: Any) -> dict[str, float]:
    """The same scores for the depth rule of the outline method."""
    from fig2mesh.image_frame import ImageFrame
    from fig2mesh.pose.prior import lift
    from fig2mesh.records import Figure

    errors = []
    arrays = (tensor.numpy()[:RULE_SAMPLES] for tensor in (sample.drawn, sample.visible, sample.joints))
    for drawn, seen, truth in zip(*arrays, strict=True):
        blank = np.zeros((1, 1), np.uint8)
        figure = Figure("", np.zeros((1, 1, 4), np.uint8), blank > 0, drawn * [1, -1], seen, blank)
        errors.append(lift(figure, ImageFrame((0.0, 0.0), 1.0)).joints[:, 2] - truth[:, 2])
    error = np.abs(np.stack(errors))
    return {"rmse_mm": 1000 * float(np.sqrt((error**2).mean())), "pck150": 100 * float((error <= 0.15).mean())}


def _variant_table(data: Path, runs: Path | None, bodies: int) -> str:
    names = tuple(VARIANTS)
    rows = []
    for variant in names:
        shape = DisnShape.of("hand", variant)
        files = sorted(runs.rglob(PART_WEIGHTS.path(shape).name)) if runs is not None else []
        files = [file for file in files if "table2" in file.parts] or files
        theirs = VARIANT_SCORES.get(variant)
        paper = (f"{theirs[0]:.3f}", f"{theirs[1]:.2f}") if theirs else ("", "")
        cells: list[str] = []
        for split in SPLITS:
            scores = [_part_scores(PART_WEIGHTS.read(file)[0], data, split, "visible", bodies) for file in files]
            cells += [_spread([s["rmse"] for s in scores], ".3f"), _spread([100 * s["iou"] for s in scores], ".1f")]
        rows.append((variant, *paper, str(len(files)), *cells))
    head = ["network", "paper RMSE", "paper IoU %", "runs"]
    head += [f"{SPLIT_TITLE[split]} {what}" for split in SPLITS for what in ("RMSE", "IoU %")]
    return "Visible masks; mean ± standard deviation over runs.\n\n" + table(head, rows)


def _spread(values: Sequence[float], form: str) -> str:
    if not values:
        return ""
    return f"{np.mean(values):{form}}" + (f" ± {np.std(values, ddof=1):{form}}" if len(values) > 1 else "")


def _part_scores(net: Disn, data: Path, split: str, mask: str, bodies: int) -> dict[str, float]:
    from fig2mesh.training.networks.train_parts import evaluate_parts

    return evaluate_parts(net, data, split, mask, bodies, dense=False, one_view=True)


def _part_tables(data: Path, bodies: int) -> str:
    text = (
        "The shipped networks: two-stream with pose points. RMSE over all nodes of a 64³ grid, decoded coarse to "
        "fine, PART units; IoU of what is inside. The cube of each part is the true one, as in the paper. Visible: the "
        "mask shows what the drawing would, and is empty for hidden parts; whole: the mask of the whole part."
    )
    rows = []
    for kind in KINDS:
        net = PART_WEIGHTS.shipped(DisnShape(kind))
        cells = [kind.replace("_", " "), f"{PART_RMSE[kind]:.3f}", f"{PART_IOU[kind]:.1f}"]
        for split in SPLITS:
            for mask in ("visible", "amodal"):
                found = _part_scores(net, data, split, mask, bodies)
                cells += [f"{found['rmse']:.3f}", f"{100 * found['iou']:.1f}"]
        rows.append(cells)
    head = ["part", "paper RMSE", "paper IoU %"]
    for split in SPLITS:
        for mask in ("visible", "whole"):
            head += [f"{SPLIT_TITLE[split]}, {mask}: RMSE", "IoU %"]
    return f"{text}\n\n{table(head, rows)}"


def _size_table(data: Path) -> str:
    from fig2mesh.training.networks.train_size import SizeTensors, read_sizes, size_scores

    names = [f"{mask}_{what}_percent" for what in ("depth", "edge") for mask in ("whole", "seen", "none")]
    rows = []
    for kind in KINDS:
        cells = []
        for split in SPLITS:
            scores = size_scores(
                SIZE_WEIGHTS.shipped(SizeShape(kind)), SizeTensors.from_sizes(read_sizes(data, split, kind), "cpu")
            )
            cells += [f"{scores[name]:.1f}" for name in names]
        rows.append((kind.replace("_", " "), *cells))
    head = [f"{what}, {mask}" for what in ("depth", "edge") for mask in ("whole mask", "visible", "none")]
    head = [f"{SPLIT_TITLE[split]}: {head[0]}" if i == 0 else name for split in SPLITS for i, name in enumerate(head)]
    return "Mean relative errors in percent of the part's extent in depth and of the edge of its cube.\n\n" + table(
        ("part", *head), rows
    )


def _figure_table(pack: Pack, figures: int) -> str:
    from fig2mesh.training.evaluate.assembled import METHODS, TRUE_DEPTHS, measure_methods

    rows, parts = [], []
    for split in SPLITS:
        found = [measure_methods(pack, split, seed) for seed in range(figures)]
        for method in (*METHODS, *(TRUE_DEPTHS + method for method in METHODS)):
            results = [one[method] for one in found]
            rows.append(
                (
                    f"{SPLIT_TITLE[split]}: {method}",
                    _spread([1000 * r.similarity.chamfer for r in results], ".1f"),
                    f"{1000 * float(np.median([r.similarity.chamfer for r in results])):.1f}",
                    f"{float(np.mean([r.similarity.normals for r in results])):.3f}",
                    f"{100 * float(np.mean([r.similarity.side_iou for r in results])):.1f}",
                    f"{100 * float(np.mean([np.mean(list(r.ious.values())) for r in results])):.1f}",
                )
            )
            by_kind: dict[str, list[float]] = {kind: [] for kind in KINDS}
            for result in results:
                for part in BODY_PARTS:
                    by_kind[PART_KIND[part]].append(result.ious.get(part, np.nan))
            means = [f"{100 * float(np.nanmean(values)):.1f}" for values in by_kind.values()]
            parts.append((f"{SPLIT_TITLE[split]}: {method}", *means))
    text = (
        "Drawings of dressed bodies (front view; silhouette and 2D joints are given, depths are not) against the "
        "bodies themselves, scaled to a drawn height of 1.79 m. A drawing does not give the distance of its figure: "
        "it is shifted in depth to where it fits best. Chamfer: mean distance of the surfaces, both ways averaged; "
        "normals: mean cosine at nearest points, both ways; side IoU: of the silhouettes seen from the figure's left. "
        "With true depths: the joints' depths are given as well, so that only shape is measured."
    )
    first = table(("method", "chamfer mm", "median mm", "normals", "side IoU %", "part IoU %"), rows)
    second = table(("part IoU %", *(kind.replace("_", " ") for kind in KINDS)), parts)
    return f"{text}\n\n{first}\n\n{second}"
