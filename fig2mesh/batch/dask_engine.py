"""Workers of a Dask cluster. All machines have the files and the output folder under the same paths.

https://distributed.dask.org/en/stable/
"""

from __future__ import annotations

import itertools
import logging
import os
import queue
import secrets
import threading
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Final

from fig2mesh.batch.engine import StageNotice, lost
from fig2mesh.batch.ledger import WORK
from fig2mesh.batch.row_job import check_row, convert_row
from fig2mesh.batch.task import Batch, Outcome, RowTask
from fig2mesh.errors import InputError

TOPIC: Final = "fig2mesh"

AHEAD: Final = 2
"""Rows submitted per thread of a worker: one in work and one queued, so that no worker waits for the scheduler."""

ANSWER_S: Final = 10.0
"""Timeout for the first answer of the scheduler, seconds."""

WORKERS_S: Final = 60.0
"""Timeout for the first worker, seconds."""

POLL_S: Final = 5.0
"""Interval at which the connection to the scheduler is checked, seconds."""

_one_at_a_time = threading.Lock()
"""A worker with several threads uses them all for one row, so that its memory is that of one row."""


@dataclass(frozen=True)
class Facts:
    """Facts about a worker.

    code : `fig2mesh.conversion.keys.fingerprint`; has_folder : whether it can access the output folder
    threads : number of threads
    """

    code: str
    has_folder: bool
    threads: int


class DaskEngine:
    """Workers of the scheduler at `address`; dry : rows are only checked.

    Raises InputError where there is no scheduler or no worker, or where a worker has another version or another disk.
    """

    def __init__(self, batch: Batch, address: str, dry: bool = False) -> None:
        try:
            from distributed import Client
        except ImportError:
            raise InputError("--engine dask", "Dask is not installed", 'run: pip install "fig2mesh[cluster]"') from None
        logging.getLogger("distributed").setLevel(logging.CRITICAL)
        self._batch, self._dry = batch, dry
        self._address = address
        remedy = "start one with: dask scheduler; see the README"
        try:
            self._client: Any = Client(address, timeout=ANSWER_S, set_as_default=False)
        except (OSError, TimeoutError, ValueError, ImportError) as error:
            reason = " ".join(str(error).split())[:120] or type(error).__name__
            raise InputError(f"--address {address}", f"no scheduler answers ({reason})", remedy) from None
        try:
            self._check()
        except BaseException:
            self._client.close()
            raise

    def _check(self) -> None:
        from fig2mesh.conversion.keys import fingerprint

        with suppress(TimeoutError):
            self._client.wait_for_workers(1, timeout=WORKERS_S)
        token = secrets.token_hex(8)
        mark = self._batch.folder / WORK / f"token-{token}"
        mark.parent.mkdir(parents=True, exist_ok=True)
        mark.touch()
        try:
            found = self._client.run(_facts, str(mark), on_error="return")
        finally:
            mark.unlink(missing_ok=True)
        if not found:
            raise InputError(
                f"--address {self._address}", "the scheduler has no workers", f"run: dask worker {self._address}"
            )
        for worker, facts in found.items():
            if not isinstance(facts, Facts):
                reason = " ".join(str(facts).split())[:120]
                raise InputError(
                    f"worker {worker}", f"cannot run fig2mesh ({reason})", "install the same version there"
                )
            if facts.code != fingerprint():
                raise InputError(
                    f"worker {worker}",
                    "has another version of fig2mesh or of a library",
                    "install the same versions there",
                )
            if not facts.has_folder:
                raise InputError(
                    f"worker {worker}",
                    f"has no access to {self._batch.folder}",
                    "give -o DIR on a disk that all machines share, under the same path",
                )
        self._threads: int = sum(facts.threads for facts in found.values())

    @property
    def workers(self) -> int:
        """Threads of all workers."""
        return self._threads

    def run(self, tasks: Iterable[RowTask]) -> Iterator[Outcome | StageNotice]:
        """See `Engine.run`; stages are reported through the scheduler's events."""
        # Dask's finished futures, and notices of stages.
        notices: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._client.subscribe_topic(TOPIC, lambda event: notices.put(StageNotice(*event[1])))
        waiting = iter(tasks)
        given: dict[str, tuple[RowTask, Any]] = {}

        def give() -> None:
            for task in itertools.islice(waiting, AHEAD * max(self._threads, 1) - len(given)):
                future = self._submit(task)
                given[future.key] = (task, future)
                future.add_done_callback(notices.put)

        try:
            give()
            while given:
                try:
                    notice = notices.get(timeout=POLL_S)
                except queue.Empty:
                    if self._client.status != "running":
                        raise OSError(f"the connection is {self._client.status}") from None
                    continue
                if isinstance(notice, StageNotice):
                    yield notice
                    continue
                task, future = given.pop(notice.key)
                outcome = self._outcome(future, task)
                future.release()
                give()
                yield outcome
        except (OSError, TimeoutError) as error:
            reason = " ".join(str(error).split())[:120] or type(error).__name__
            raise InputError(
                f"--address {self._address}",
                f"lost the connection to the scheduler ({reason})",
                "start it and its workers, and run the same command again",
            ) from None
        finally:
            with suppress(Exception):
                self._client.unsubscribe_topic(TOPIC)
            self._client.close()

    def _submit(self, task: RowTask) -> Any:
        key = f"fig2mesh-{task.number}-{secrets.token_hex(4)}"
        # Lower numbers first, so that a row whose worker was lost is retried before new rows.
        return self._client.submit(_row, self._batch, task, self._dry, key=key, pure=False, priority=-task.number)

    def _outcome(self, future: Any, task: RowTask) -> Outcome:
        if future.status == "finished":
            found = future.result()
            assert isinstance(found, Outcome)
            return found
        if future.status != "error":
            raise OSError(f"a row is {future.status}")
        error = future.exception()
        if type(error).__name__ == "KilledWorker":
            return lost(task, "its workers died; see their logs")
        text = " ".join(str(error).split())[:200] or type(error).__name__
        return lost(task, f"lost by the cluster: {text}")


def _facts(mark: str, dask_worker: Any) -> Facts:
    """Run on every worker; dask_worker : the worker, passed by Dask to functions with a parameter of this name."""
    from fig2mesh.conversion.keys import fingerprint

    return Facts(fingerprint(), os.path.exists(mark), dask_worker.state.nthreads)


def _row(batch: Batch, task: RowTask, dry: bool) -> Outcome:
    """Convert or check one row in a worker of the cluster."""
    from distributed import get_worker

    worker = get_worker()

    def advance(stage: str) -> None:
        # A tuple of plain values: the scheduler stores events, and does not have our classes.
        worker.log_event(TOPIC, (str(worker.name), task.number, task.name, stage))

    with _one_at_a_time, _threads(worker.state.nthreads):
        return check_row(batch, task) if dry else convert_row(batch, task, advance)


def _threads(count: int) -> Any:
    """Make libraries use as many threads as the worker has."""
    import numba
    import torch
    from threadpoolctl import threadpool_limits

    torch.set_num_threads(count)
    numba.set_num_threads(min(count, numba.config.NUMBA_NUM_THREADS))
    return threadpool_limits(count)
