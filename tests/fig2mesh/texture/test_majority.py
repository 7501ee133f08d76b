"""Areas keep their colour unless most of what is painted behind them has another."""

from __future__ import annotations

import numpy as np

from fig2mesh.texture.majority import recoloured_by_majority

SHIRT, SKIN, COAT = 0, 1, 2


def picture() -> np.ndarray:
    """A coat with an open front that shows a shirt, and a face above."""
    kind = np.full((60, 40), COAT)
    kind[20:50, 15:25] = SHIRT
    kind[0:15] = SKIN
    return kind


def every_pixel(kind: np.ndarray) -> np.ndarray:
    return np.argwhere(np.ones_like(kind, bool))


PLACES = np.array([[30, 20], [5, 20], [30, 5]])
"""Row and column of some pixel of each colour."""


def result_of(kind: np.ndarray, pixels: np.ndarray, votes: np.ndarray) -> np.ndarray:
    return recoloured_by_majority(kind, pixels, PLACES[votes])


def test_an_area_goes_as_a_whole_where_most_votes_are_for_one_other_colour() -> None:
    kind = picture()
    pixels = every_pixel(kind)
    votes = kind[pixels[:, 0], pixels[:, 1]].copy()
    shirt = votes == SHIRT
    # The network is sure of two thirds of it only, and leaves a ragged rest.
    votes[shirt & (np.random.default_rng(0).random(len(votes)) < 0.66)] = COAT
    result = result_of(kind, pixels, votes)
    assert (result[20:50, 15:25] == COAT).all()
    np.testing.assert_array_equal(result[:20], kind[:20])


def test_a_minority_changes_nothing() -> None:
    kind = picture()
    pixels = every_pixel(kind)
    votes = kind[pixels[:, 0], pixels[:, 1]].copy()
    votes[np.random.default_rng(0).random(len(votes)) < 0.4] = SKIN
    np.testing.assert_array_equal(result_of(kind, pixels, votes), kind)


def test_areas_of_one_colour_vote_apart() -> None:
    kind = picture()
    kind[52:58, 5:35] = SHIRT
    pixels = every_pixel(kind)
    votes = kind[pixels[:, 0], pixels[:, 1]].copy()
    upper = (pixels[:, 0] < 50) & (votes == SHIRT)
    votes[upper] = COAT
    result = result_of(kind, pixels, votes)
    assert (result[20:50, 15:25] == COAT).all()
    assert (result[52:58, 5:35] == SHIRT).all()


def test_few_votes_and_votes_beyond_the_picture_do_not_count() -> None:
    kind = picture()
    few = np.array([[30, 20]] * 5)
    np.testing.assert_array_equal(result_of(kind, few, np.full(5, COAT)), kind)
    beyond = np.array([[-1, 20], [30, 40], [60, 0]] * 20)
    inside = np.array([[30, 20]] * 60)
    np.testing.assert_array_equal(recoloured_by_majority(kind, beyond, inside), kind)
    np.testing.assert_array_equal(recoloured_by_majority(kind, inside, beyond), kind)
    np.testing.assert_array_equal(recoloured_by_majority(kind, np.zeros((0, 2), int), np.zeros((0, 2), int)), kind)
