"""The pack: what is saved comes back, whole packs only."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fig2mesh.errors import FigureError
from fig2mesh.training.bodies.pack import HELD_OUT_SHARE, held_out, load_pack, save_pack
from tests.fig2mesh.training.figures import capsule_pack


def _agree(saved: Any, found: Any, where: str) -> None:
    """Records field by field: whole numbers and texts exactly, the rest to the 11 bits of half precision."""
    if is_dataclass(saved):
        for field in fields(saved):
            # MakeHuman's clothes are bound to the full body; once they are offsets nobody needs it.
            if field.name != "full":
                _agree(getattr(saved, field.name), getattr(found, field.name), f"{where}.{field.name}")
    elif isinstance(saved, np.ndarray):
        assert saved.dtype == found.dtype, where
        assert saved.shape == found.shape, where
        if saved.dtype == np.float32:
            np.testing.assert_allclose(found, saved, rtol=1e-3, atol=1e-5, err_msg=where)
        else:
            np.testing.assert_array_equal(found, saved, err_msg=where)
    elif isinstance(saved, tuple) and saved and is_dataclass(saved[0]):
        assert len(saved) == len(found), where
        for k, (a, b) in enumerate(zip(saved, found, strict=True)):
            _agree(a, b, f"{where}[{k}]")
    else:
        assert saved == found, where


def test_what_is_saved_comes_back(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "pack.npz"
    save_pack(capsule_pack(), path)
    found = load_pack(path)
    _agree(capsule_pack(), found, "pack")
    weight = found.anny.rig.bone_weight.sum(axis=1)
    np.testing.assert_allclose(weight, 1, atol=1e-6)
    assert [entry.name for entry in path.parent.iterdir()] == ["pack.npz"]


def test_what_is_no_pack_is_told_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(FigureError, match=r"no such file; .*fig2mesh data pack"):
        load_pack(tmp_path / "pack.npz")
    broken = tmp_path / "broken.npz"
    broken.write_bytes(b"no archive")
    other = tmp_path / "other.npz"
    np.savez(other, joints=np.zeros((1, 21, 3)))
    for path in (broken, other):
        with pytest.raises(FigureError, match=r"not a pack of this version.*fig2mesh data pack") as caught:
            load_pack(path)
        assert "\n" not in str(caught.value)


def test_names_decide_who_is_held_out() -> None:
    unseen = {name: held_out(name) for name in ("Ann", "Ida", "coat", "suit", "shoes", "boots")}
    assert [name for name, kept in unseen.items() if kept] == ["Ida", "suit", "boots"]
    assert not any(held_out(f"made-{k}") for k in range(100))
    assert np.mean([held_out(f"person {k}") for k in range(4000)]) == pytest.approx(HELD_OUT_SHARE, abs=0.02)
