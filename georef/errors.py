"""Errors whose cause is the user's input.

One small tree for all three packages: whatever derives from `InputError` becomes one line on stderr and exit
code 2 in the command line; anything else is a fault of ours.
"""

from __future__ import annotations

from typing import ClassVar

MOST_CHARACTERS = 600
"""Of each part of a message: a path may be long, a text out of a file has no business to be."""


def one_line(text: str) -> str:
    """A text as one line that a terminal only shows: what it would act on, or cannot encode, becomes a mark.

    Spaces and line breaks become one space each; longer texts than `MOST_CHARACTERS` lose their middle.
    """
    if not text.isprintable():
        text = "".join(c if c.isprintable() else "\ufffd" for c in " ".join(text.split()))
    half = MOST_CHARACTERS // 2
    return text if len(text) <= MOST_CHARACTERS else f"{text[:half]}…{text[-half:]}"


class InputError(Exception):
    """Input that cannot be used: names the input, the finding and the remedy.

    Parameters
    ----------
    source : which input (a file name or an option)
    finding : what was found in it
    remedy : what to do about it

    `lasting`: the same input fails again until it is changed, so that a batch need not try again.

    Texts out of files become part of it, so it is made one line of printable characters, see `one_line`.
    """

    lasting: ClassVar[bool] = False

    def __init__(self, source: object, finding: str, remedy: str) -> None:
        self.source = one_line(str(source))
        self.finding = one_line(finding)
        self.remedy = one_line(remedy)
        super().__init__(f"{self.source}: {self.finding}; {self.remedy}")


class PlacementError(InputError):
    """A place on the earth that does not exist or cannot be computed."""
