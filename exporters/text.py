"""Texts that every format can hold: names of files may be no UTF-8, and Python then holds them as lone surrogates."""

from __future__ import annotations

import os
import re
from typing import Any

from exporters.errors import ExportError

LONE_SURROGATE = re.compile("[\ud800-\udfff]")
"""Characters that Python puts in place of bytes that are not UTF-8."""


def plain_text(text: str) -> str:
    """Text without NUL, and with U+FFFD for each lone surrogate, which UTF-8 cannot represent."""
    if text.isascii() and "\0" not in text:
        return str(text)  # also converts subclasses
    return LONE_SURROGATE.sub("\N{REPLACEMENT CHARACTER}", text.replace("\0", ""))


def plain_texts(value: Any) -> Any:
    """The same for all texts in dictionaries, lists and tuples, keys included."""
    if isinstance(value, str):
        return plain_text(value)
    if isinstance(value, dict):
        return {plain_texts(key): plain_texts(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return type(value)(map(plain_texts, value))
    return value


def check_utf8(path: str | os.PathLike[str]) -> None:
    """Raise ExportError for a path that is not UTF-8: files refer to each other by name, and USD and GDAL refuse it."""
    if LONE_SURROGATE.search(os.fspath(path)):
        raise ExportError(os.fspath(path), "its name is not UTF-8", "choose another name")
