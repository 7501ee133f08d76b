"""Shards: the same bytes whenever they are made, never mixed with those of another recipe."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from fig2mesh.errors import FigureError
from fig2mesh.skeleton import PART
from fig2mesh.training.bodies import subject as subject_module
from fig2mesh.training.bodies.pack import save_pack
from fig2mesh.training.samples import build as build_module
from fig2mesh.training.samples import sample as samples
from fig2mesh.training.samples.build import BuildOptions, build, shards
from tests.fig2mesh.training.figures import capsule_pack

NODES = 8


@pytest.fixture(scope="module", autouse=True)
def small() -> Iterator[None]:
    """Two bodies a shard, coarse grids, and no cuts of rigs that other tests gave the same names."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(build_module, "SHARD", 2)
        patch.setattr(build_module, "VALID_SHARD", 1)
        patch.setattr(build_module, "_PACK", {})
        patch.setattr(samples, "GRID", NODES)
        patch.setattr(subject_module, "_CUTS", {})
        yield


@pytest.fixture(scope="module")
def pack(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("pack") / "pack.npz"
    save_pack(capsule_pack(), path)
    return path


@pytest.fixture(scope="module")
def made(pack: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("made") / "data"
    build(pack, out, BuildOptions(bodies=3, valid=1, pictures=False))
    return out


def test_shards_of_all_splits(made: Path) -> None:
    names = ["train-00000", "train-00001", "valid-characters-00000", "valid-clips-00000"]
    assert sorted(path.name for path in made.iterdir()) == ["build.json", *(f"{name}.npz" for name in names)]
    rows = []
    for split in ("train", "valid-clips", "valid-characters"):
        for path in shards(made, split):
            with np.load(path) as archive:
                rows.append(len(archive["seed"]))
                assert ("grid" in archive) == (split != "train")
                assert {len(archive[name]) for name in archive.files} == {rows[-1]}
                if split == "valid-clips":
                    assert archive["grid"].shape == (1, 14, NODES, NODES, NODES)
                    assert archive["clip"][0].startswith("unseen/")
                elif split == "train":
                    assert archive["clip"][0].startswith("seen/")
    assert rows == [2, 1, 1, 1]
    with pytest.raises(FigureError, match="holds no test data"):
        shards(made, "test")


@pytest.mark.parametrize("damage", ["gone", "no archive"])
def test_what_is_missing_or_corrupt_is_made_again_with_the_same_bytes(pack: Path, made: Path, damage: str) -> None:
    path, kept = made / "train-00001.npz", made / "train-00000.npz"
    before, untouched = path.read_bytes(), kept.stat().st_mtime_ns
    path.unlink()
    if damage != "gone":
        path.write_bytes(damage.encode())
    counts: list[tuple[int, int]] = []
    build(
        pack,
        made,
        BuildOptions(bodies=3, valid=1, pictures=False),
        report=lambda done, total: counts.append((done, total)),
    )
    assert path.read_bytes() == before
    assert counts == [(0, 1), (1, 1)]
    assert kept.stat().st_mtime_ns == untouched


@pytest.mark.parametrize("change", [{"seed": 1}, {"pictures": True}])
def test_another_recipe_is_refused_in_one_line(pack: Path, made: Path, change: dict[str, int]) -> None:
    before = {path.name: path.read_bytes() for path in made.iterdir()}
    with pytest.raises(FigureError, match="another recipe") as caught:
        build(pack, made, BuildOptions(**{"bodies": 3, "valid": 1, "pictures": False, **change}))  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)
    assert {path.name: path.read_bytes() for path in made.iterdir()} == before


def test_a_missing_pack_leaves_no_folder(tmp_path: Path) -> None:
    with pytest.raises(FigureError, match="no such file"):
        build(tmp_path / "pack.npz", tmp_path / "data")
    assert not (tmp_path / "data").exists()


def test_pictures_have_the_documented_shapes_and_show_the_parts(pack: Path, tmp_path: Path) -> None:
    build(pack, tmp_path, BuildOptions(bodies=1, valid=0, pictures=True))
    with np.load(tmp_path / "train-00000.npz") as archive:
        found = {name: (archive[name].shape, archive[name].dtype.name) for name in ("picture", "labels", "depth", "uv")}
        labels, depth = archive["labels"], archive["depth"]
    assert found == {
        "picture": ((1, 4, 256, 256, 3), "uint8"),
        "labels": ((1, 4, 256, 256), "uint8"),
        "depth": ((1, 4, 256, 256), "float16"),
        "uv": ((1, 4, 256, 256, 2), "float16"),
    }
    np.testing.assert_array_equal(np.isfinite(depth), labels > 0)
    assert set(np.unique(labels)) >= {0, PART["torso"], PART["head"], PART["l_foot"], PART["r_foot"]}
