"""Separate processes that need neither semaphores nor a guarded main module.

Pools of the standard library need POSIX semaphores, which some containers and serverless platforms lack, and import
the caller's main module again, which runs a script without `if __name__ == "__main__"` a second time in each process.
"""

from __future__ import annotations

import multiprocessing
import signal
import sys
import threading
import types
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from typing import Any, TypeVar

Result = TypeVar("Result")

_starting = threading.Lock()


class ProcessLost(Exception):
    """A process ended before it could answer; `code` : its exit code."""

    def __init__(self, code: int) -> None:
        self.code = code
        super().__init__(f"a process ended with exit code {code}")


def start(function: Callable[..., object], *args: Any, name: str, daemon: bool = True) -> tuple[Any, Connection]:
    """Start `function(pipe, *args)` in a new process; return the process and our end of the pipe.

    Raises OSError where the system gives no process.
    """
    ours, theirs = multiprocessing.Pipe()
    try:
        process = multiprocessing.get_context("spawn").Process(
            target=function, args=(theirs, *args), daemon=daemon, name=name
        )
        with _without_main():
            process.start()
    except BaseException:
        ours.close()
        raise
    finally:
        theirs.close()
    return process, ours


def run_apart(function: Callable[..., Result], *args: Any) -> Result:
    """Return `function(*args)`, run in a process of its own, or in this one where there can be none.

    Raises what the function raises, and ProcessLost if the process ends while the function runs.
    """
    try:
        process, pipe = start(_answer, function, args, name="fig2mesh-apart")
    except OSError:
        return function(*args)
    begun = False
    try:
        begun = pipe.recv() is None
        fault, result = pipe.recv()
    except (EOFError, OSError):
        process.join()
        if not begun:
            return function(*args)
        raise ProcessLost(process.exitcode or 0) from None
    except BaseException:
        process.kill()
        raise
    finally:
        pipe.close()
        process.join(5)
    if fault is not None:
        raise fault
    answer: Result = result
    return answer


def _answer(pipe: Connection, function: Callable[..., object], args: tuple[Any, ...]) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole process group; the parent handles it
    pipe.send(None)
    try:
        answer = (None, function(*args))
    except Exception as error:
        pipe.send((error, None))
        return
    pipe.send(answer)


@contextmanager
def _without_main() -> Iterator[None]:
    """Set the main module aside, so that the new process does not import it."""
    with _starting:
        main = sys.modules["__main__"]
        sys.modules["__main__"] = types.ModuleType("__main__")
        try:
            yield
        finally:
            sys.modules["__main__"] = main
