"""Cost of each effect, as a share of a plain frame: `python -m tests.benchmarks.effects docs/effects.md`.

Each effect is timed in turn with the plain frame, in processor time, and the median of the pairs' ratios is written:
machines are noisy, but both halves of a pair run within a second.
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

from fig2mesh.parse.read import read_figure
from fig2mesh.render.effects import Effect, Mode
from fig2mesh.render.frame import render_frame
from fig2mesh.render.job import field_scene
from fig2mesh.render.picture import PictureRequest, render, view_of
from fig2mesh.render.scene import FieldScene
from fig2mesh.settings import PRESETS

FIGURE = Path(__file__).parents[2] / "examples" / "figures" / "farmer"
SIZE, PAIRS = (480, 640), 5

ROWS: tuple[tuple[Mode, tuple[Effect, ...]], ...] = (
    ("depth", ()),
    ("parts", ()),
    ("normals", ()),
    ("clay", ()),
    ("textured", ()),
    ("textured", ("light",)),
    ("textured", ("sun",)),
    ("textured", ("light", "shadow")),
    ("textured", ("ao",)),
    ("textured", ("outline",)),
    ("textured", ("perspective",)),
    ("textured", ("blend",)),
    ("textured", ("smooth-union",)),
)


def farmer(*effects: Effect) -> FieldScene:
    """The shipped farmer at standard quality, with colours."""
    figure = read_figure(FIGURE / "image.png", keypoints=FIGURE / "keypoints.json")
    return field_scene(figure, PRESETS["standard"], request("textured", *effects))


def table(scene: FieldScene, smooth: FieldScene) -> str:
    """The costs as Markdown."""
    plain = request("depth")
    camera = view_of(scene, plain).camera

    def bare() -> object:
        return render_frame(scene.body, camera)

    lines = [
        "| mode | effects | time, plain frame = 1 | rays from the camera | further rays | normals | texture samples |",
        "|---|---|---|---|---|---|---|",
        f"| | tracing alone | {ratio(bare, lambda: render(scene, plain)):.2f} | {SIZE[0] * SIZE[1]:,} | | | |",
    ]
    for mode, effects in ROWS:
        requested, at = request(mode, *effects), smooth if "smooth-union" in effects else scene
        cost = ratio(lambda at=at, requested=requested: render(at, requested), lambda: render(scene, plain))
        counts = asdict(render(at, requested).counts)
        further = [
            f"{counts[f'{name}_rays']:,} {title}"
            for name, title in (("sight", "to the viewer"), ("shadow", "to the lamp"), ("ao", "for ao"))
            if counts[f"{name}_rays"]
        ]
        row = [mode, ", ".join(effects) or "none", f"{cost:.2f}", f"{counts['camera_rays']:,}", "; ".join(further)]
        row += [f"{counts[name]:,}" if counts[name] else "" for name in ("normals", "texture_samples")]
        lines.append("| " + " | ".join(row) + " |")
        print(lines[-1], file=sys.stderr)
    return "\n".join(lines) + "\n"


def request(mode: Mode, *effects: Effect) -> PictureRequest:
    return PictureRequest(mode, frozenset(effects), SIZE, sun=(0.5, 0.7, 0.5))


def ratio(job: Callable[[], object], plain: Callable[[], object]) -> float:
    """Time of a job over that of the plain frame."""
    job(), plain()
    return statistics.median(seconds(job) / seconds(plain) for _ in range(PAIRS))


def seconds(job: Callable[[], object]) -> float:
    """Of all cores together."""
    start = time.process_time()
    job()
    return time.process_time() - start


HEAD = f"""# What effects cost

`fig2mesh render` of the shipped farmer through its part fields, {SIZE[0]} × {SIZE[1]} pixels, one ray each, seen from
the front. A plain frame is `--mode depth` without effects: rays and where they end. Median of {PAIRS} ratios of
processor times, each of two frames made one after the other; made by
`OMP_NUM_THREADS=1 python -m tests.benchmarks.effects docs/effects.md`.

"""

TAIL = """
Rays from the camera go by tiles (`fig2mesh.render.frame`): those of tiles that cannot see the figure are answered
without being traced, the others start next to the surface. Further rays start on the surface and are traced one by one
(`fig2mesh.field.trace`), hence each costs more.

Only requested work is done: `depth` and `parts` have no normals and no textures, and no frame has rays to a lamp
or for occlusion that it does not show. The numbers of `--report JSON` are those of the table, and tests hold them.
The figure covers a quarter of the picture; costs of colours and light grow with what it covers.
`smooth-union` is done once, before the first frame.

![Each effect on the farmer](effects.jpg)
"""


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "build/effects.md")
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(HEAD + table(farmer(), farmer("smooth-union")) + TAIL)
    print(f"written to {target}")
