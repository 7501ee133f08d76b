"""Shards of training data, made in sequence or by several processes."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from typing import Any


def make_shards(
    make: Callable[..., object], tasks: Sequence[tuple[Any, ...]], jobs: int, report: Callable[[int, int], None]
) -> None:
    """Call `make` with each task's arguments, in `jobs` processes; `report` gets the numbers of done and all tasks."""
    done = 0
    report(done, len(tasks))
    if jobs == 1:
        for task in tasks:
            make(*task)
            report(done := done + 1, len(tasks))
        return
    with ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("spawn")) as pool:
        for future in as_completed([pool.submit(make, *task) for task in tasks]):
            future.result()
            report(done := done + 1, len(tasks))
