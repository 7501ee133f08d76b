"""Drawn faces: eyes, brows, nose, mouth and beard from three points."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fig2mesh.training.drawing.marks import FloatImage, composite, ellipse, stroke
from fig2mesh.training.drawing.styles import Style


class Face(NamedTuple):
    """Position of a face.

    eyes : (N, 2) x, y in pixels of the visible eyes, 1 or 2 of them
    mouth : (2,) x, y in pixels
    turn : rotation of the face to the right of the picture, -1 (left profile) to 1; 0 faces the viewer
    """

    eyes: NDArray[np.floating]
    mouth: NDArray[np.floating]
    turn: float = 0.0


def draw_face(
    picture: FloatImage,
    face: Face,
    canvas: NDArray[np.bool_],
    style: Style,
    hair: NDArray[np.floating],
    rng: np.random.Generator,
) -> FloatImage:
    """Draw a face on the picture.

    canvas : (H, W) bool, bare skin of the head; nothing is drawn beside it
    hair : (3,) 0-255, colour of brows and beard
    """
    eyes, mouth = np.asarray(face.eyes, float).reshape(-1, 2), np.asarray(face.mouth, float)
    middle = eyes.mean(axis=0)
    size = float(np.hypot(*(mouth - middle)))
    if not len(eyes) or size < 1:
        return picture
    down = (mouth - middle) / size
    right = np.array([down[1], -down[0]])
    shape = canvas.shape
    turn, smile, open_mouth, bushy = face.turn, rng.normal(0.12, 0.12), rng.random() < 0.15, rng.uniform(0.07, 0.16)
    gaze = right * 0.08 * rng.normal() + right * 0.06 * turn
    narrow = max(1 - 0.55 * abs(turn), 0.45)

    def place(x: float, y: float, origin: NDArray[np.floating] = mouth) -> NDArray[np.floating]:
        """Convert face coordinates, in distances from eyes to mouth, to pixels."""
        return np.asarray(origin + size * (x * right + y * down))

    row, column = np.clip(middle[::-1].astype(int), 0, np.array(shape) - 1)
    dark = picture[row, column].mean() < 110  # pupils and lines need a lighter ground there
    black = np.zeros(shape, np.float32)
    if rng.random() < 0.25:  # cheeks
        for side in (-1, 1):
            cheek = ellipse(shape, place(side * 0.6 * narrow + 0.2 * turn, -0.35), (0.22 * size, 0.18 * size))
            picture = composite(picture, (226, 110, 100), 0.35 * cheek * canvas)
    if style.beard != "none":
        picture = composite(picture, hair, _beard(style.beard, shape, mouth, right, down, size, narrow) * canvas)
    for eye in eyes:
        if style.eyes == "open" or dark:
            white = ellipse(shape, eye, (0.26 * size * narrow, 0.17 * size), float(np.arctan2(right[1], right[0])))
            picture = composite(picture, (252, 252, 250), white * canvas)
            arc = [place(x * narrow, -0.17 * (1 - (x / 0.27) ** 2), eye) for x in np.linspace(-0.27, 0.27, 5)]
            stroke(black, arc, 0.07 * size)
        radii = (0.1 * size, 0.1 * size) if style.eyes != "ovals" else (0.08 * size, 0.16 * size)
        np.maximum(black, ellipse(shape, eye + gaze * size, radii), out=black)
    features = [
        [place(x * narrow, -0.42 - bow, eye) for x, bow in ((-0.25, 0.0), (0.0, 0.08), (0.25, 0.0))] for eye in eyes
    ]
    brows = np.zeros(shape, np.float32)
    for line in features:
        stroke(brows, line, bushy * size)
    bend = 0.0 if abs(turn) > 0.3 else rng.choice([-0.1, 0.1])
    tip = place(bend + 0.28 * turn, -0.42)
    stroke(black, [place(0.15 * turn, -0.85), tip, place(0.05 * turn, -0.36)][rng.integers(2) :], 0.06 * size)
    half = rng.uniform(0.2, 0.42) * narrow
    lips = [place(x * half, smile * (0.5 - x * x)) for x in np.linspace(-1, 1, 7)]
    if open_mouth:
        np.maximum(black, ellipse(shape, mouth, (half * 0.7 * size, 0.13 * size)), out=black)
    elif rng.random() < 0.25:
        red = np.zeros(shape, np.float32)
        stroke(red, lips, 0.16 * size)
        picture = composite(picture, (186, 60, 60), red * canvas)
    stroke(black, lips, 0.08 * size)
    picture = composite(picture, np.minimum(hair, 150), brows * canvas)
    return composite(picture, np.minimum(style.ink, 90), black * canvas)


def _beard(
    kind: str,
    shape: tuple[int, ...],
    mouth: NDArray[np.floating],
    right: NDArray[np.floating],
    down: NDArray[np.floating],
    size: float,
    narrow: float,
) -> FloatImage:
    """(H, W) coverage of a beard or moustache; it leaves the mouth free."""
    angle = float(np.arctan2(right[1], right[0]))
    out = np.zeros(shape, np.float32)
    if kind == "full":
        out = ellipse(shape, mouth + 0.25 * size * down, (1.05 * size, 0.75 * size), angle)
        lips = ellipse(shape, mouth - 0.02 * size * down, (0.36 * size * narrow, 0.14 * size), angle)
        cheeks = ellipse(shape, mouth - 0.75 * size * down, (0.85 * size, 0.62 * size), angle)
        return np.asarray(out * (1 - lips) * (1 - cheeks), np.float32)
    if kind == "goatee":
        return ellipse(shape, mouth + 0.5 * size * down, (0.3 * size * narrow, 0.36 * size), angle)
    wings = [mouth + size * (x * narrow * right + (0.4 * x * x - 0.2) * down) for x in np.linspace(-0.5, 0.5, 7)]
    stroke(out, wings, 0.16 * size)
    return out
