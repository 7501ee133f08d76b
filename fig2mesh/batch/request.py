"""Request of `fig2mesh batch`."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import field
from pathlib import Path
from typing import Any, Literal

from fig2mesh.conversion.fields import check_fields, option, request_class
from fig2mesh.conversion.request import check_visible_from
from fig2mesh.errors import InputError


@request_class
class BatchRequest:
    """A collection, and options for converting it.

    defaults : options of the main command for rows without them, by column
    """

    collection: Path = option(
        kw_only=False, argument=True, help="CSV, GeoJSON or GeoPackage with a row for each figure."
    )
    output: Path | None = option(default=None, short="o", metavar="DIR", help="Output folder.")
    jobs: int | None = option(
        default=None,
        low=1,
        high=1024,
        metavar="N",
        help="Number of rows to convert at a time. Default: one per core, as far as memory allows.",
    )
    engine: Literal["local", "dask"] = option(
        default="local", help="Run worker processes on this machine, or use a Dask cluster."
    )
    address: str | None = option(default=None, metavar="tcp://…", help="Address of the Dask scheduler.")
    resume: bool = option(
        default=True, negative="fresh", help="Keep the finished figures of an earlier run, or convert everything again."
    )
    formats: tuple[str, ...] = option(
        default=(),
        name="format",
        metavar="SUFFIX",
        help="Additional output format besides .glb, such as usdz. Repeatable.",
    )
    dry_run: bool = option(default=False, help="Check all rows and report problems, without writing anything.")
    progress: Literal["auto", "bar", "json", "none"] = option(
        default="auto",
        help="Progress display. json: one event per line on stdout. With -v the bar shows the stage of each worker.",
    )
    timeout: float = option(default=1800.0, low=1, metavar="S", help="Time limit per row, seconds (local engine only).")
    root: Path | None = option(
        default=None,
        metavar="DIR",
        help="Rows may only refer to files inside this folder. Default: COLLECTION's folder.",
    )
    layer: str | None = option(
        default=None, metavar="NAME", help="Layer of a GeoPackage. Default: the only one with a column figure."
    )
    unplaced: bool = option(default=False, help="Accept rows without a place on the earth.")
    date: str | None = option(
        default=None,
        metavar="DATE",
        help="Date in the STAC catalogue of rows without one: 1893, 1893-05-17 or 1893/1895.",
    )
    title: str | None = option(
        default=None, metavar="TEXT", help="Title of the STAC catalogue. Default: COLLECTION without its suffix."
    )
    license: str | None = option(
        default=None,
        metavar="SPDX|URL",
        help="Licence of the figures in the STAC catalogue: an SPDX identifier such as CC-BY-4.0, or the address of "
        "its text.",
    )
    visible_from: float | None = option(
        default=None,
        metavar="M",
        help="Distance at which clients begin to draw a figure, metres, on a screen 1080 pixels high. Default: about "
        "1,100 times its height.",
    )
    overwrite: bool = option(default=False, help="Replace existing files in DIR that are not from an earlier batch.")
    defaults: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_fields(self)
        check_visible_from(self.visible_from)
        if self.engine == "dask" and self.address is None:
            raise InputError("--engine dask", "requires --address", "add --address tcp://HOST:8786")
        if self.engine == "local" and self.address is not None:
            raise InputError("--address", "requires --engine dask", "add --engine dask")
        if self.output is None and not self.dry_run:
            raise InputError("-o", "no output folder", "give -o DIR")
        if self.license is not None and not re.fullmatch(r"https?://\S+|[\w.+-]+", self.license, re.ASCII):
            raise InputError(
                "--license",
                f"{self.license[:40]!r} is neither an SPDX identifier nor an address",
                "give one such as CC-BY-4.0, or https://…",
            )
        if self.root is not None and not self.root.is_dir():
            raise InputError(
                "--root", f"no such directory {self.root}", "name a folder that contains the collection's files"
            )

    @property
    def row_defaults(self) -> dict[str, Any]:
        """Values for rows that do not have them, by column."""
        found = dict(self.defaults)
        if self.formats:
            found["format"] = self.formats
        if self.date is not None:
            found["date"] = self.date
        return found
