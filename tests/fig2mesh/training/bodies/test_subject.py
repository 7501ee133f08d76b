"""Subjects: who is drawn in which split, in what pose, how large, in what proportions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields

import numpy as np
import pytest

from fig2mesh.skeleton import FIGURE_HEIGHT, JOINT
from fig2mesh.training.bodies import subject as subject_module
from fig2mesh.training.bodies.caricature import Proportions, caricature, draw_proportions
from fig2mesh.training.bodies.rig import Rig
from fig2mesh.training.bodies.subject import SPLITS, Subject, draw_subject
from tests.fig2mesh.training.figures import NAMES, capsule_man, capsule_pack

SEEN = {"Ann", "coat", "shoes"}
UNSEEN = {"Ida", "suit", "boots"}


@pytest.fixture(autouse=True)
def no_cuts_of_other_tests(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cuts are kept by the rig's name for a whole process."""
    monkeypatch.setattr(subject_module, "_CUTS", {})


def drawn(split: str, count: int = 60) -> list[Subject]:
    return [draw_subject(capsule_pack(), split, seed) for seed in range(count)]


def test_training_never_meets_what_is_held_out_and_validation_does() -> None:
    wear = {split: [set(s.character.split("+")) for s in drawn(split)] for split in SPLITS}
    clips = {split: {s.clip for s in drawn(split)} for split in SPLITS}
    for split in ("train", "valid-clips"):
        assert not set().union(*wear[split]) & UNSEEN
        assert set().union(*wear[split]) >= SEEN
    assert not set().union(*wear["valid-characters"]) & SEEN
    assert set().union(*wear["valid-characters"]) >= UNSEEN
    for split, source in (("train", "seen"), ("valid-characters", "seen"), ("valid-clips", "unseen")):
        assert {clip.split("/")[0] for clip in clips[split]} == {source}


@pytest.mark.parametrize("split", SPLITS)
def test_subjects_stand_as_high_as_the_paper_says(split: str) -> None:
    """A limb gives the scale: it is as long as at rest, times what makes the rest stance 1.79 high."""
    for subject in drawn(split, 10):
        scale = FIGURE_HEIGHT / np.ptp(subject.rig.vertices[:, 1])
        for first, last in (("l_hip", "l_knee"), ("r_shoulder", "r_elbow"), ("neck", "thorax")):
            posed, rest = (
                np.linalg.norm(x[JOINT[first]] - x[JOINT[last]]) for x in (subject.joints, subject.rig.joint_rest)
            )
            tolerance = 0.05 if first == "neck" else 1e-4  # the neck bends
            assert posed == pytest.approx(rest * scale, abs=tolerance)
        np.testing.assert_allclose(subject.joints[JOINT["pelvis"]], 0, atol=1e-9)
        assert subject.uv.shape == (len(subject.rig.faces), 3, 2)
        assert len(subject.vertices) == len(subject.rig.vertices)


def test_a_seed_is_a_subject() -> None:
    first, again, other = (draw_subject(capsule_pack(), "train", seed) for seed in (3, 3, 4))
    np.testing.assert_array_equal(first.vertices, again.vertices)
    assert (first.character, first.clip) == (again.character, again.clip)
    assert first.vertices.shape != other.vertices.shape or not np.allclose(first.vertices, other.vertices)


def test_skirts_hang_about_the_legs() -> None:
    skirts = [s for s in drawn("train") if len(s.skirt_faces)]
    assert 3 <= len(skirts) <= 25
    for subject in skirts:
        hips = subject.joints[[JOINT["l_hip"], JOINT["r_hip"]]].mean(axis=0)
        assert np.linalg.norm(subject.skirt_vertices.mean(axis=0) - hips) < 0.6
        assert subject.character.startswith("anny+")


def test_unknown_splits_are_refused() -> None:
    with pytest.raises(ValueError, match="valid-clips"):
        draw_subject(capsule_pack(), "test", 0)


def _alone(bone: str, axis: int) -> Callable[[Rig], float]:
    """Extent along an axis of what hangs on one bone only."""

    def measure(rig: Rig) -> float:
        own = (rig.bone_weight[:, 0] > 0.99999) & (rig.bone_index[:, 0] == NAMES.index(bone))
        return float(np.ptp(rig.vertices[own, axis]))

    return measure


def _between(first: str, last: str) -> Callable[[Rig], float]:
    return lambda rig: float(np.linalg.norm(rig.joint_rest[JOINT[first]] - rig.joint_rest[JOINT[last]]))


# fmt: off
MEASURES = {
    "head": _alone("head", 1), "hand": _alone("l_finger", 2), "foot": _alone("r_foot", 0),
    "arm_length": _between("l_shoulder", "l_elbow"), "leg_length": _between("r_hip", "r_knee"),
    "arm_girth": _alone("r_lower_arm", 2), "leg_girth": _alone("l_upper_leg", 2),
    "torso_width": _alone("hips", 0), "torso_height": _between("thorax", "pelvis"), "torso_depth": _alone("hips", 2),
}
# fmt: on


@pytest.mark.parametrize("name", MEASURES)
def test_a_proportion_changes_what_it_names_and_nothing_else(name: str) -> None:
    rig = capsule_man("man")
    changed, _ = caricature(rig, Proportions(**{name: 1.3}))
    factors = {measure: of(changed) / of(rig) for measure, of in MEASURES.items()}
    assert factors == pytest.approx({measure: 1.3 if measure == name else 1.0 for measure in MEASURES}, abs=1e-4)


def test_proportions_are_drawn_for_some_and_kept_within_bounds() -> None:
    rng = np.random.default_rng(0)
    found = [draw_proportions(rng) for _ in range(400)]
    changed = [p for p in found if p != Proportions()]
    assert 0.45 < len(changed) / len(found) < 0.65
    values = np.array([[getattr(p, f.name) for f in fields(p)] for p in changed])
    assert (values > 0.55).all()
    assert (values < 2.05).all()
    rig = capsule_man("man")
    assert caricature(rig, Proportions())[0] is rig
