"""Whether what was found in a picture is a person.

The score is the mean confidence of the inferred joints. Measured on 2026-12-01 with the shipped network: 26 pictures of
single figures have 0.58 to 0.87, 44 whole people cut out of crowded pages 0.29 to 0.74, 153 pictures without a person
(maps, landscapes, animals, lettering, bindings, drawn cats, trees, houses, text, blank paper) up to 0.53. At this limit
none of the 26 is refused, 12 of the 44 (small ones, of whose joints at least a third is unsure) and 141 of the 153.
"""

from __future__ import annotations

from typing import Final

from fig2mesh.errors import FigureError

MIN_SCORE: Final = 0.46
"""Score below which a picture is refused."""

SURE_SCORE: Final = 0.55
"""Score below which it is doubtful."""

REMEDY: Final = "pass --bbox round the person, --keypoints and --mask, or --force to go on"


def person_doubts(score: float) -> tuple[str, ...]:
    """Doubt about a picture with a score, if there is any."""
    if score >= SURE_SCORE:
        return ()
    return (f"{'hardly' if score < MIN_SCORE else 'perhaps not'} a person (score {score:.2f})",)


def check_person(source: object, score: float | None, force: bool) -> None:
    """Raise FigureError for a score, None where the joints were given, that is too low for a person."""
    if score is not None and score < MIN_SCORE and not force:
        raise FigureError(str(source), f"hardly a person: score {score:.2f}, below {MIN_SCORE}", REMEDY)
