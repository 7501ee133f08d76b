"""Local worker processes, which handle one row at a time each and keep the networks loaded."""

from __future__ import annotations

import itertools
import logging
import os
import signal
import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Any, Final

from fig2mesh.batch.engine import StageNotice, lost
from fig2mesh.batch.row_job import check_row, convert_row
from fig2mesh.batch.task import Batch, Outcome, RowTask
from fig2mesh.system.processes import start

# fmt: off
THREADS: Final = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS",
                  "VIPS_CONCURRENCY")
# fmt: on

TRIES: Final = 2
"""Attempts per row whose workers die; after that the row is at fault, or the machine has too little memory."""

PARENT_S: Final = 1.0
"""Interval at which a worker checks that its parent is alive, seconds."""


log = logging.getLogger("fig2mesh")


@dataclass
class _Worker:
    process: Any
    pipe: Connection
    task: RowTask | None = None
    since: float = 0.0


class LocalEngine:
    """Engine of `jobs` processes; timeout_s : for each row; dry : rows are only checked.

    Where the system gives no processes, rows are processed in this one, which has no limit of time.
    """

    def __init__(self, batch: Batch, jobs: int, timeout_s: float, dry: bool = False) -> None:
        self._batch, self._jobs, self._timeout_s, self._dry = batch, jobs, timeout_s, dry

    @property
    def workers(self) -> int:
        """Number of processes."""
        return self._jobs

    def run(self, tasks: Iterable[RowTask]) -> Iterator[Outcome | StageNotice]:
        """See `Engine.run`."""
        queue = iter(tasks)
        again: list[RowTask] = []
        deaths: dict[int, int] = {}
        workers: list[_Worker] = []
        any_begun = False

        def give(worker: _Worker) -> bool:
            task = again.pop() if again else next(queue, None)
            worker.task = task
            if task is None:
                return False
            worker.since = time.monotonic()
            with suppress(OSError):  # a worker that has died is detected by its pipe
                worker.pipe.send(task)
            return True

        def add() -> bool:
            try:
                worker = self._start()
            except OSError:  # too many processes, too little memory, or not allowed
                return False
            workers.append(worker)
            return give(worker)

        def replace(worker: _Worker) -> None:
            workers.remove(worker)
            add()

        try:
            for _ in range(self._jobs):
                if not add():
                    break
            while busy := {worker.pipe: worker for worker in workers if worker.task is not None}:
                for pipe in wait(list(busy), timeout=1.0):
                    worker = busy.pop(pipe)  # type: ignore[call-overload]
                    task = worker.task
                    assert task is not None
                    try:
                        message = worker.pipe.recv()
                    except (EOFError, OSError):
                        code = self._end(worker)
                        if not any_begun:  # no process can run fig2mesh at all
                            again.append(task)
                            workers.remove(worker)
                            continue
                        deaths[task.number] = deaths.get(task.number, 0) + 1
                        if deaths[task.number] < TRIES:
                            again.append(task)
                        else:
                            yield _died(task, code)
                        replace(worker)
                        continue
                    if message is None:
                        any_begun = True
                    elif isinstance(message, Outcome):
                        give(worker)
                        yield message
                    else:
                        yield StageNotice(str(worker.process.pid), task.number, task.name, message)
                for worker in busy.values():  # those without a message
                    if worker.task is not None and time.monotonic() - worker.since > self._timeout_s:
                        task = worker.task
                        worker.process.kill()
                        self._end(worker)
                        yield lost(task, f"took more than {self._timeout_s:g} s; raise --timeout")
                        replace(worker)
            yield from self._run_here(again, queue)
        finally:
            for worker in workers:
                if worker.task is not None:
                    worker.process.kill()
                with suppress(OSError):
                    worker.pipe.close()
            for worker in workers:
                worker.process.join(5)

    def _run_here(self, again: list[RowTask], queue: Iterator[RowTask]) -> Iterator[Outcome | StageNotice]:
        """Process what no worker could be had for in this process."""
        for number, task in enumerate(itertools.chain(again, queue)):
            if not number:
                log.warning("no worker processes can be started here; rows are processed in this one, one at a time")
            notices: list[str] = []
            outcome = check_row(self._batch, task) if self._dry else convert_row(self._batch, task, notices.append)
            for stage in notices:
                yield StageNotice(str(os.getpid()), task.number, task.name, stage)
            yield outcome

    def _start(self) -> _Worker:
        threads = max(1, (os.cpu_count() or 1) // self._jobs)
        # Libraries read these when they are loaded, so they are set before a process starts.
        with _environment({name: os.environ.get(name, str(threads)) for name in THREADS}):
            return _Worker(*start(_work, self._batch, self._dry, os.getpid(), name="fig2mesh-worker"))

    @staticmethod
    def _end(worker: _Worker) -> int:
        worker.pipe.close()
        worker.process.join()
        return int(worker.process.exitcode or 0)


def _died(task: RowTask, code: int) -> Outcome:
    how = f"signal {-code}" if code < 0 else f"exit code {code}"
    hint = "; it may have run out of memory: try fewer --jobs" if code == -signal.SIGKILL else ""
    return lost(task, f"its worker ended with {how}, {TRIES} times{hint}")


@contextmanager
def _environment(values: dict[str, str]) -> Iterator[None]:
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _work(pipe: Connection, batch: Batch, dry: bool, parent: int) -> None:
    """Main loop of a worker: receive tasks, send stages and outcomes, until the pipe is closed."""
    # Ctrl-C reaches the whole process group; the parent handles it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_watch, args=(parent,), daemon=True).start()
    with suppress(EOFError, OSError):
        pipe.send(None)
        while True:
            task = pipe.recv()
            pipe.send(check_row(batch, task) if dry else convert_row(batch, task, pipe.send))


def _watch(parent: int) -> None:
    """Exit when the parent has ended, however it ended, so that orphaned rows do not disturb the next run."""
    while os.getppid() == parent:
        time.sleep(PARENT_S)
    os._exit(1)
