"""Pages of `fig2mesh view` in a browser: the shader against the compiled tracer, effects, controls."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from skimage.metrics import structural_similarity

from fig2mesh.commands.main import main
from fig2mesh.view.page import EFFECTS
from tests.browser import Look, pixels
from tests.drawn import write_figure
from tests.fig2mesh.view.conftest import Painted
from tests.fig2mesh.view.reference import picture

PLAIN = ("texture", "light", "smooth-union")
RICH = ("texture", "blend", "creases", "light", "ao", "smooth-union")
# fmt: off
VIEWS = (
    (0.0, 0.0, PLAIN), (40.0, 10.0, PLAIN), (0.0, 0.0, RICH), (-40.0, 15.0, RICH), (180.0, 0.0, RICH),
    (65.0, -20.0, ("texture", "perspective")), (90.0, 70.0, ("texture",)),
)
# fmt: on


def test_pictures_are_those_of_the_compiled_tracer(painted: Painted, page: Path, look: Look) -> None:
    actions = [{"picture": {"yaw": yaw, "pitch": pitch, "effects": effects}} for yaw, pitch, effects in VIEWS]
    found = look(page.as_uri(), *actions)
    assert found["messages"] == []
    assert len(found["results"]) == len(VIEWS)
    for (yaw, pitch, effects), result in zip(VIEWS, found["results"], strict=True):
        image = pixels(result["png"]).astype(float)
        camera = {"size": 256, "height": result["height"], "centre": result["centre"]}
        expected = picture(painted, yaw, pitch, effects, **camera)
        share = image[..., 3:] / 255
        page_rgb = image[..., :3] * share + 255 * (1 - share)
        own_rgb = expected[..., :3] + 255 * (1 - expected[..., 3:])
        similarity = structural_similarity(page_rgb, own_rgb, channel_axis=2, data_range=255)
        assert similarity >= 0.95, (yaw, pitch, effects)
        # Rays that graze: the texture's numbers have 16 bits, and anything thinner than a fifth of a node is invisible.
        differ = (image[..., 3] > 127) != (expected[..., 3] > 0.5)
        assert differ.sum() <= 0.002 * differ.size
        assert (share > 0).mean() > 0.05
        assert image[0, 0, 3] == 0  # transparent background


@pytest.mark.slow
def test_an_effect_that_is_off_is_not_in_the_program(page: Path, look: Look) -> None:
    base = ["texture", "light"]
    # Each effect is switched from what it is in the base, and back.
    views = [base, *(names for effect in EFFECTS for names in (sorted({*base} ^ {effect}), base))]
    actions = [{"picture": {"yaw": 30, "pitch": 0, "effects": names}} for names in views]
    turned = {"picture": {"yaw": 60, "pitch": 0, "effects": base}}
    found = look(page.as_uri(), *actions, turned, size=(48, 48))
    assert found["messages"] == []
    before, *changes, last = found["results"]
    for effect, toggled, back in zip(EFFECTS, changes[::2], changes[1::2], strict=True):
        define = effect.upper().replace("-", "_")
        assert {*toggled["defines"]} == {*before["defines"]} ^ {define}
        assert toggled["png"] != before["png"], effect
        assert back["defines"] == before["defines"]
        assert back["png"] == before["png"]
        assert (toggled["compiles"], back["compiles"]) == (before["compiles"] + 1, before["compiles"] + 2)
        before = back
    assert last["compiles"] == before["compiles"]
    assert last["png"] != before["png"]


def test_turned_by_mouse_keys_and_touch(page: Path, look: Look) -> None:
    found = look(
        page.as_uri() + "#effects=light&yaw=10",
        {"drag": [50, 0]},
        {"drag": [0, 25]},
        {"key": "ArrowLeft"},
        {"key": "ArrowRight"},
        {"key": "ArrowUp"},
        {"touch": [-40, 0]},
        {"pinch": [40, 80]},
        {"wheel": -200},
        {"key": "0"},
        {"key": "o"},
        {"toggle": "light"},
        size=(800, 400),
    )
    assert found["messages"] == []
    drag, tilt, left, right, up, touch, pinch, wheel, home, key, box = found["results"]
    # To the right: the figure's right side comes to the front, so the camera's yaw falls, by 0.4 degrees a pixel.
    assert drag["yaw"] == pytest.approx(350)
    assert tilt["pitch"] == pytest.approx(10)
    assert left["yaw"] == pytest.approx(355)
    assert right["yaw"] == pytest.approx(350)
    assert up["pitch"] == pytest.approx(15)
    assert touch["yaw"] == pytest.approx(6)
    assert pinch["zoom"] == pytest.approx(2)
    assert (pinch["yaw"], pinch["pitch"]) == (touch["yaw"], touch["pitch"])
    assert wheel["zoom"] > 2.2
    assert (home["yaw"], home["pitch"], home["zoom"]) == (0, 0, 1)
    assert key["defines"] == ["LIGHT", "OUTLINE"]
    assert box["defines"] == ["OUTLINE"]
    assert box["compiles"] == home["compiles"] + 2


def test_nothing_is_loaded(page: Path, look: Look) -> None:
    found = look(page.as_uri(), {"evaluate": "document.title"}, {"evaluate": "window.fig2mesh.effects"})
    title, effects = found["results"]
    assert found["requests"] == [page.as_uri()]
    assert title["value"] == "Mannequin & <friend>"
    assert effects["value"] == list(EFFECTS)


def test_an_outline_runs_round_the_silhouette(page: Path, look: Look) -> None:
    actions = [
        {"picture": {"yaw": 20, "pitch": 0, "effects": effects}} for effects in (["light"], ["light", "outline"])
    ]
    bare, lined = (pixels(result["png"]) for result in look(page.as_uri(), *actions)["results"])
    added = (lined[..., 3] > 200) & (bare[..., 3] < 50)
    inside = bare[..., 3] > 200
    border = np.pad(inside, 1)
    near = border[:-2, 1:-1] | border[2:, 1:-1] | border[1:-1, :-2] | border[1:-1, 2:]
    # All pixels next to the silhouette are ink, and few others.
    assert (added & near & ~inside).sum() >= 0.95 * (near & ~inside).sum()
    assert (lined[added][:, :3].max(axis=1) < 60).mean() > 0.99


def test_the_front_is_the_drawing(tmp_path: Path, look: Look) -> None:
    files, page = write_figure(tmp_path), tmp_path / "page.html"
    options = ["--keypoints", str(files.keypoints), "--quality", "draft", "--parts", "outline", "-q"]
    assert main(["view", str(files.image), *options, "-o", str(page)]) == 0
    size = 512
    found = look(page.as_uri(), {"picture": {"yaw": 0, "pitch": 0, "effects": ["texture"]}}, size=(size, size))
    assert found["messages"] == []
    (result,) = found["results"]
    image = pixels(result["png"]).astype(float)
    # The drawing on the same canvas: its silhouette is 1.79 units high.
    with Image.open(files.image) as opened:
        drawing = opened.convert("RGBA")
    box = drawing.getchannel("A").getbbox()
    factor = 1.79 / (box[3] - box[1]) * size / result["height"]
    width, height = (round(n * factor) for n in (box[2] - box[0], box[3] - box[1]))
    canvas = Image.new("RGBA", (size, size))
    canvas.paste(
        drawing.crop(box).resize((width, height), Image.Resampling.BOX), ((size - width) // 2, (size - height) // 2)
    )
    expected = np.asarray(canvas).astype(float)
    shown, drawn = image[..., 3] > 127, expected[..., 3] > 127
    assert (shown & drawn).sum() / (shown | drawn).sum() >= 0.97
    both = [picture[..., :3] * picture[..., 3:] / 255 + 255 - picture[..., 3:] for picture in (image, expected)]
    assert structural_similarity(*both, channel_axis=2, data_range=255) >= 0.95
