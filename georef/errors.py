"""Errors whose cause is the user's input.

One small hierarchy for all three packages: whatever derives from `InputError` becomes one line on stderr and exit
code 2 in the command line; anything else is an internal error.
"""

from __future__ import annotations

from typing import ClassVar

MAX_CHARACTERS = 600
"""Limit for each part of a message: a path may be long, a text from a file should not be."""


def one_line(text: str) -> str:
    """Return a text as one line of printable characters; control characters and what cannot be encoded become U+FFFD.

    Runs of whitespace become one space; texts longer than `MAX_CHARACTERS` lose their middle.
    """
    if not text.isprintable():
        text = "".join(c if c.isprintable() else "\ufffd" for c in " ".join(text.split()))
    half = MAX_CHARACTERS // 2
    return text if len(text) <= MAX_CHARACTERS else f"{text[:half]}…{text[-half:]}"


class InputError(Exception):
    """Input that cannot be used: names the input, the finding and the remedy.

    Parameters
    ----------
    source : name of the input (a file name or an option)
    finding : the problem
    remedy : the way to solve it

    `permanent`: the same input fails again until it is changed, so a batch need not retry it.

    Texts from files become part of the message, so it is reduced to one printable line, see `one_line`.
    """

    permanent: ClassVar[bool] = False

    def __init__(self, source: object, finding: str, remedy: str) -> None:
        self.source = one_line(str(source))
        self.finding = one_line(finding)
        self.remedy = one_line(remedy)
        super().__init__(f"{self.source}: {self.finding}; {self.remedy}")

    def __reduce__(self) -> tuple[type[InputError], tuple[str, str, str]]:
        # By default from the message alone, with which the error cannot be made again in another process.
        return type(self), (self.source, self.finding, self.remedy)


class PlacementError(InputError):
    """A place on the earth that does not exist or cannot be computed."""
