"""Compilation of kernels, and their distribution over the processor's cores.

Kernels release the interpreter lock and are shared out to ordinary threads. That was preferred to numba's own parallel
loops: its `workqueue` layer, the only one present on a minimal system, ends the process when two threads call at once,
and a parallel kernel takes about twice as long to compile.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from typing import Any, TypeVar, cast

import numba
import numpy as np
from numba.core.caching import FunctionCache
from numpy.typing import NDArray

from fig2mesh.field.kernel_cache import NOT_KEPT, kernel_folder, warn_once

Function = TypeVar("Function", bound=Callable[..., Any])

THREADS_VARIABLE = "FIG2MESH_THREADS"
"""Environment variable that limits the threads of one process; by default as many as the process may use cores."""

_SHARES_PER_THREAD = 4  # more shares than threads, so that a share of misses does not leave a core idle
_lock = threading.Lock()
_pools: dict[tuple[int, int], ThreadPoolExecutor] = {}


def kernel(function: Function) -> Function:
    """Compile `function` on first use, keep the machine code on disk if possible, release the interpreter lock."""
    dispatcher = numba.njit(nogil=True, error_model="numpy")(function)
    warn_once(kernel_folder().note)
    if kernel_folder().path is not None:
        _keep(dispatcher)
    return cast(Function, dispatcher)


class KernelCache(FunctionCache):  # type: ignore[misc]
    """Cache whose faults cost a compilation, not the run: a full disk, damaged files, a folder that has gone."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the compiled code for a signature, None where there is none to use."""
        try:
            return super().load_overload(sig, target_context)
        except Exception:
            with suppress(Exception):
                self.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep the compiled code for a signature."""
        with suppress(Exception):
            super().save_overload(sig, data)


def _keep(dispatcher: Any) -> None:
    """Keep compiled code of a kernel in `kernel_folder`; as numba's `enable_caching`, which fails without a folder."""
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = kernel_folder().numba_dir
    try:
        dispatcher._cache = KernelCache(dispatcher.py_func)
    except (RuntimeError, OSError, ValueError):
        warn_once(NOT_KEPT)
    finally:
        numba.config.CACHE_DIR = before


def helper(function: Function) -> Function:
    """As `kernel`, for functions that are called only by other kernels: stored with those, and quicker to compile."""
    bare = numba.njit(nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True, _nrt=False)
    return cast(Function, bare(function))


def thread_count() -> int:
    """Number of threads used by kernels."""
    wanted = os.environ.get(THREADS_VARIABLE, "")
    if wanted.isdigit() and int(wanted) > 0:
        return int(wanted)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def sealed(array: Any, dtype: Any) -> NDArray[Any]:
    """A read-only, C-ordered view (or converted copy): one array type for the kernels, hence one compilation."""
    view = np.ascontiguousarray(array, dtype=dtype).view()
    view.flags.writeable = False
    return view


def run_blocks(run: Callable[[int, int], None], count: int, block: int) -> None:
    """Call `run(first, step)` so that together the calls treat all blocks `first, first + step, ...` of `count` items.

    Blocks are dealt out like cards: neighbouring blocks cost alike (a body's rows, the sky above it), so every
    share gets some of each. What is computed for an item does not depend on the number of threads.
    """
    blocks = -(-count // block)
    threads = min(thread_count(), blocks)
    if threads <= 1:
        run(0, 1)
        return
    shares = min(threads * _SHARES_PER_THREAD, blocks)
    # The calling thread takes shares too; a pool per process id, because threads do not survive a fork.
    futures = [_pool(threads - 1).submit(run, share, shares) for share in range(1, shares)]
    run(0, shares)
    for future in reversed(futures):
        if future.cancel():  # still waiting in the queue
            run(futures.index(future) + 1, shares)
    for future in futures:
        if not future.cancelled():
            future.result()


def _pool(threads: int) -> ThreadPoolExecutor:
    key = (os.getpid(), threads)
    with _lock:
        if key not in _pools:
            _pools[key] = ThreadPoolExecutor(threads, thread_name_prefix="fig2mesh-field")
        return _pools[key]
