"""Errors whose cause is the user's input.

One small tree for all three packages: whatever derives from `InputError` becomes one line on stderr and exit
code 2 in the command line; anything else is a fault of ours.
"""

from __future__ import annotations


class InputError(ValueError):
    """Input that cannot be used: names the input, the finding and the remedy.

    Parameters
    ----------
    source : which input (a file name or an option)
    finding : what was found in it
    remedy : what to do about it
    """

    def __init__(self, source: object, finding: str, remedy: str) -> None:
        self.source = str(source)
        self.finding = finding
        self.remedy = remedy
        super().__init__(f"{self.source}: {finding}; {remedy}")


class PlacementError(InputError):
    """A place on the earth that does not exist or cannot be computed."""
