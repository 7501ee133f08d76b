"""Request of `fig2mesh batch`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from pathlib import Path
from typing import Any, Literal

from fig2mesh.conversion.fields import check_fields, option, request_class
from fig2mesh.conversion.request import check_visible_from
from fig2mesh.errors import InputError


@request_class
class BatchRequest:
    """A collection, and how it is converted.

    defaults : options of the main job for rows that have none, by column
    """

    collection: Path = option(
        kw_only=False, argument=True, help="CSV, GeoJSON or GeoPackage with a row for each figure."
    )
    output: Path | None = option(default=None, short="o", metavar="DIR", help="Folder of the outputs.")
    jobs: int | None = option(
        default=None, low=1, high=1024, metavar="N", help="Rows at a time; default: one for each core."
    )
    engine: Literal["local", "dask"] = option(
        default="local", help="Worker processes of this machine, or a Dask cluster."
    )
    address: str | None = option(default=None, metavar="tcp://…", help="Of the Dask scheduler.")
    resume: bool = option(
        default=True, negative="fresh", help="Keep what an earlier run has finished, or make everything anew."
    )
    formats: tuple[str, ...] = option(
        default=(), name="format", metavar="SUFFIX", help="Made besides .glb, such as usdz; repeatable."
    )
    dry_run: bool = option(default=False, help="Check every row, report all problems, write nothing.")
    progress: Literal["auto", "bar", "json", "none"] = option(
        default="auto", help="json: events on stdout, one a line. With -v the bar shows what each worker does."
    )
    timeout: float = option(
        default=1800.0, low=1, metavar="S", help="Longest that a row may take (local engine), seconds."
    )
    root: Path | None = option(
        default=None, metavar="DIR", help="Folder that rows' files may not leave; default: COLLECTION's."
    )
    layer: str | None = option(
        default=None, metavar="NAME", help="Of a GeoPackage; default: the one with a column figure."
    )
    unplaced: bool = option(default=False, help="Rows need no place on the earth.")
    date: str | None = option(
        default=None,
        metavar="DATE",
        help="Of rows that have none: 1893, 1893-05-17, 1893/1895; for the catalogue.",
    )
    title: str | None = option(default=None, metavar="TEXT", help="Of the catalogue; default: COLLECTION's stem.")
    visible_from: float | None = option(
        default=None,
        metavar="M",
        help="Distance from which a figure is drawn, on a screen of 1080 rows; default: about 1,100 times its height.",
    )
    overwrite: bool = option(default=False, help="Replace files in DIR that are not of an earlier batch.")
    defaults: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_fields(self)
        check_visible_from(self.visible_from)
        if self.engine == "dask" and self.address is None:
            raise InputError("--engine dask", "no scheduler is named", "pass --address tcp://HOST:8786")
        if self.engine == "local" and self.address is not None:
            raise InputError("--address", "given without --engine dask", "pass --engine dask as well")
        if self.output is None and not self.dry_run:
            raise InputError("-o", "no folder for the outputs", "pass -o DIR")
        if self.root is not None and not self.root.is_dir():
            raise InputError("--root", f"no folder {self.root}", "name a folder that holds the collection's files")

    @property
    def row_defaults(self) -> dict[str, Any]:
        """What holds for rows that do not say it, by column."""
        found = dict(self.defaults)
        if self.formats:
            found["format"] = self.formats
        if self.date is not None:
            found["date"] = self.date
        return found
