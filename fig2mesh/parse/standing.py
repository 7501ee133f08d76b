"""Joints of a standing person, moved and scaled to joints that are known."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from fig2mesh.records import FloatArray
from fig2mesh.skeleton import JOINT_MIRROR, JOINT_NAMES, STANDING, without_side


def standing() -> NDArray[np.float64]:
    """(21, 2) joints of a standing person who faces the viewer, in heights; x from the midline, y down."""
    sides = [-1.0 if name.startswith("r_") else 1.0 for name in JOINT_NAMES]
    places = [STANDING[without_side(name)] for name in JOINT_NAMES]
    return np.array([(side * x, y) for side, (x, y) in zip(sides, places, strict=True)])


def fitted(known: Mapping[str, NDArray[np.float64]]) -> FloatArray:
    """(21, 2) joints, IMAGE: those that are known as they are, the others those of a standing person."""
    has = np.array([name in known for name in JOINT_NAMES])
    places = np.array([known.get(name, np.zeros(2)) for name in JOINT_NAMES], np.float64)
    return np.where(has[:, None], places, moved(standing(), places, has)).astype(np.float32)


def moved(model: NDArray[np.floating], places: NDArray[np.floating], known: NDArray[np.bool_]) -> NDArray[np.float64]:
    """(21, 2) joints of a model, moved and scaled, with its sides exchanged where that fits better.

    places : (21, 2), which the known joints of the model should meet (least squares)
    """
    found = []
    for order in (np.arange(len(JOINT_NAMES)), np.array(JOINT_MIRROR)):
        own = np.asarray(model, np.float64)[order]
        centre, target = own[known].mean(axis=0), np.asarray(places, np.float64)[known].mean(axis=0)
        away, wanted = own[known] - centre, places[known] - target
        scale = max(float((away * wanted).sum() / max(float((away * away).sum()), 1e-12)), 0.0)
        out = target + scale * (own - centre)
        found.append((float(((out[known] - places[known]) ** 2).sum()), out))
    best: NDArray[np.float64] = min(found, key=lambda each: each[0])[1]
    return best
