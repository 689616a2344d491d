"""Where the work of an experiment is done: here, in processes, or on a dask cluster of the user's own."""

from __future__ import annotations

import multiprocessing
import re
import signal
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from functools import partial

from ..errors import BadInput
from ..threads import set_threads

ANSWER = 10.0
"""Seconds that a scheduler has for its first answer."""
MOST_ON_WINDOWS = 61
"""Processes of a pool there: the limit of `concurrent.futures`."""
_ADDRESS = re.compile(r"(tcp|tls|ws|wss|ucx)://[^\s:/]+:\d{1,5}")


@contextmanager
def executor_for(
    workers: int = 1, scheduler: str | None = None, threads: int | None = None
) -> Iterator[Executor | None]:
    """An executor for the block; None for one worker, which is this process.

    An exception in the block, Ctrl-C among them, ends the processes: each run in them writes its checkpoint first.

    Parameters
    ----------
    workers : int, optional
        processes to start, each a new interpreter.
    threads : int or None, optional
        of each of them; one by default, because they share the cores.
    scheduler : str or None, optional
        address of a running dask scheduler, "tcp://host:port", instead. Work of a worker that dies is done
        again by another.

    Raises
    ------
    BadInput
        no address, no `distributed`, no answer, or more workers than Windows allows.
    """
    if scheduler is not None:
        with _dask(scheduler) as executor:
            yield executor
    elif workers == 1:
        yield None
    elif workers > MOST_ON_WINDOWS and sys.platform == "win32":
        raise BadInput(f"workers = {workers}; on Windows Python starts at most {MOST_ON_WINDOWS} processes")
    else:
        context = multiprocessing.get_context("spawn")
        begin = partial(_leave_signals_to_parent, threads or 1)
        with ProcessPoolExecutor(workers, mp_context=context, initializer=begin) as pool:
            _start(pool, workers)
            processes = list((getattr(pool, "_processes", None) or {}).values())
            try:
                yield pool
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                for process in processes:  # or the program would end only with the piece of work they are at
                    process.terminate()
                raise


def _leave_signals_to_parent(threads: int) -> None:
    """Ctrl-C goes to all processes of a terminal; the parent alone answers it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    set_threads(threads)


def _nothing() -> None:
    """Work that makes the pool start a process."""


def _start(pool: Executor, workers: int) -> None:
    """Start all processes now, deaf to Ctrl-C from their first moment on."""
    here = threading.current_thread() is threading.main_thread()
    before = signal.signal(signal.SIGINT, signal.SIG_IGN) if here else None
    try:
        for future in [pool.submit(_nothing) for _ in range(workers)]:
            future.result()
    finally:
        if here:
            signal.signal(signal.SIGINT, before)


@contextmanager
def _dask(address: str) -> Iterator[Executor]:
    if not _ADDRESS.fullmatch(address):
        raise BadInput(f"scheduler {address!r} must be an address such as tcp://127.0.0.1:8786")
    try:
        from distributed import Client
    except ImportError:
        raise BadInput("a scheduler needs dask: pip install 'sand[dask]'") from None
    try:
        client = Client(address, timeout=ANSWER, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise BadInput(f"the scheduler at {address} does not answer within {ANSWER:g} s ({reason})") from None
    try:
        with client.get_executor(pure=False, retries=3) as executor:
            yield executor
    finally:
        client.close()
