"""The drawn figures: the pictures come from the SVGs, and joints and masks fit them."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy import ndimage

from fig2mesh.skeleton import JOINT_NAMES

pytest.importorskip("resvg_py")

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
FIGURES = EXAMPLES / "figures"
NAMES = ("farmer", "footballer", "market_woman")


def _module():
    spec = importlib.util.spec_from_file_location("draw_figures", EXAMPLES / "draw_figures.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    out = tmp_path_factory.mktemp("figures")
    folders = _module().run(out)
    assert [folder.name for folder in folders] == list(NAMES)
    assert (out / "skeletons.png").is_file()
    return out


def _pixels(path: Path) -> np.ndarray:
    return np.asarray(Image.open(path)).astype(int)


def _joints(name: str) -> dict[str, list[float]]:
    return json.loads((FIGURES / name / "keypoints.json").read_text(encoding="utf-8"))["keypoints"]


@pytest.mark.parametrize("name", NAMES)
def test_the_picture_is_what_the_svg_renders_to(drawn, name):
    stored, fresh = _pixels(FIGURES / name / "image.png"), _pixels(drawn / name / "image.png")
    assert stored.shape == fresh.shape
    off = np.abs(stored - fresh).max(axis=-1)
    assert (off > 16).mean() < 2e-3  # another version of the renderer may smooth edges a little differently
    assert off.mean() < 0.5


@pytest.mark.parametrize("name", NAMES)
def test_the_mask_is_what_the_svg_renders_to(drawn, name):
    stored, fresh = _pixels(FIGURES / name / "mask.png"), _pixels(drawn / name / "mask.png")
    assert stored.shape == fresh.shape
    assert (stored != fresh).mean() < 1e-3


@pytest.mark.parametrize("name", NAMES)
def test_the_keypoints_are_those_of_the_svg(drawn, name):
    stored, fresh = FIGURES / name / "keypoints.json", drawn / name / "keypoints.json"
    assert json.loads(stored.read_text(encoding="utf-8")) == json.loads(fresh.read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", NAMES)
def test_the_mask_is_alpha_and_one_piece(name):
    image, mask = _pixels(FIGURES / name / "image.png"), _pixels(FIGURES / name / "mask.png")
    assert image.shape == (*mask.shape, 4)
    assert set(np.unique(mask)) == {0, 255}
    np.testing.assert_array_equal(mask > 0, image[..., 3] >= 128)
    assert ndimage.label(mask)[1] == 1
    assert mask[1:-1, 1:-1].sum() == mask.sum(), "touches the edge of the picture"


@pytest.mark.parametrize("name", NAMES)
def test_all_joints_lie_in_the_picture_and_the_visible_ones_on_the_figure(name):
    mask = _pixels(FIGURES / name / "mask.png") > 0
    height, width = mask.shape
    outside = ndimage.distance_transform_edt(~mask)
    joints = _joints(name)
    assert tuple(joints) == JOINT_NAMES
    for joint, (x, y, visible) in joints.items():
        assert visible in (0, 1), joint
        assert 0 <= x < width, joint
        assert 0 <= y < height, joint
        assert not visible or outside[round(y), round(x)] <= 3, joint


@pytest.mark.parametrize("name", NAMES)
def test_left_is_the_figures_own_left(name):
    """All three turn their front to the viewer, so their left is at the right of the picture."""
    joints = _joints(name)
    for pair in ("shoulder", "elbow", "hip", "knee", "ankle", "foot"):
        assert joints[f"l_{pair}"][0] > joints[f"r_{pair}"][0], pair


@pytest.mark.parametrize("name", NAMES)
def test_bones_have_the_proportions_of_a_body(name):
    """Hidden joints too: a pair of bones of one kind may be foreshortened, but not to less than half."""
    joints = {joint: np.array(at[:2]) for joint, at in _joints(name).items()}
    for first, second in (("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle")):
        left, right = (np.linalg.norm(joints[f"{s}_{first}"] - joints[f"{s}_{second}"]) for s in "lr")
        assert 0.5 <= left / right <= 2, (first, second)
    assert joints["eyes"][1] < joints["neck"][1] < joints["thorax"][1] < joints["pelvis"][1]


@pytest.mark.parametrize("name", NAMES)
def test_source_names_author_and_licence(name):
    source = json.loads((FIGURES / name / "source.json").read_text(encoding="utf-8"))
    assert source["title"]
    assert source["author"] == "fig2mesh authors"
    assert source["licence"] == "MIT"


@pytest.mark.parametrize("name", NAMES)
def test_the_files_are_small(name):
    for path in (FIGURES / name).iterdir():
        assert path.stat().st_size < 200_000, path


def test_a_figure_in_two_pieces_is_rejected():
    rgba = np.zeros((8, 8, 4), np.uint8)
    rgba[1:3, 1:3, 3] = rgba[5:7, 5:7, 3] = 255
    with pytest.raises(ValueError, match="2 pieces"):
        _module().mask_of(Image.fromarray(rgba))


def test_a_drawing_with_a_missing_joint_is_rejected(tmp_path):
    svg = (FIGURES / "farmer" / "figure.svg").read_text(encoding="utf-8").replace("joint-l_knee", "joint-knee")
    (tmp_path / "figure.svg").write_text(svg, encoding="utf-8")
    with pytest.raises(ValueError, match="l_knee"):
        _module().read_keypoints(tmp_path / "figure.svg")
