"""Executors of experiments: this process, worker processes, or a dask cluster."""

from __future__ import annotations

import multiprocessing
import os
import re
import signal
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from functools import partial

from ..errors import BadInput, import_optional
from ..forces.own import IMPORTED, import_modules
from ..threads import set_threads

ANSWER = 10.0
"""Timeout of the connection to a scheduler [s]."""
MOST_ON_WINDOWS = 61
"""Largest number of processes of a pool on Windows, a limit of `concurrent.futures`."""
SAFE_PATH = "PYTHONSAFEPATH"
"""Environment variable by which Python leaves the current folder out of its path."""
_ADDRESS = re.compile(r"(tcp|tls|ws|wss|ucx)://[^\s:/]+:\d{1,5}")


@contextmanager
def executor_for(
    workers: int = 1, scheduler: str | None = None, threads: int | None = None
) -> Iterator[Executor | None]:
    """Context manager of an executor; None for a single worker, which is this process.

    Exceptions in the block, including Ctrl-C, terminate the worker processes; each run writes its checkpoint first.

    Parameters
    ----------
    workers : int, optional
        Number of processes, each a new interpreter.
    scheduler : str or None, optional
        Address of a running dask scheduler, "tcp://host:port", used instead of processes. Work of a worker that dies is
        repeated by another.
    threads : int or None, optional
        Threads of each process; one by default, because the processes share the cores.

    Raises
    ------
    BadInput
        If the address is invalid, `distributed` is not installed, the scheduler does not answer, or Windows does not
        allow so many workers.
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
        begin = partial(_begin_worker, threads or 1, list(IMPORTED))
        with _safe_path():  # the first lock of a pool starts a process, too
            pool = ProcessPoolExecutor(workers, mp_context=context, initializer=begin)
            _start(pool, workers)
        with pool:
            processes = list((getattr(pool, "_processes", None) or {}).values())
            try:
                yield pool
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                for process in processes:  # otherwise the program would wait for their current tasks
                    process.terminate()
                raise


def _begin_worker(threads: int, imports: list[str]) -> None:
    """Ignore Ctrl-C, which a terminal sends to all processes; only the parent handles it and shows notes."""
    from ..compiler.progress import suppress_notes

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    set_threads(threads)
    suppress_notes()
    import_modules(imports)


def _nothing() -> None:
    """Task that makes the pool start a process."""


def _start(pool: Executor, workers: int) -> None:
    """Start all processes, which ignore Ctrl-C from their start."""
    in_main = threading.current_thread() is threading.main_thread()
    before = signal.signal(signal.SIGINT, signal.SIG_IGN) if in_main else None
    try:
        for future in [pool.submit(_nothing) for _ in range(workers)]:
            future.result()
    finally:
        if in_main:
            signal.signal(signal.SIGINT, before)


@contextmanager
def _safe_path() -> Iterator[None]:
    """New interpreters begin without the current folder on their path; later they get the path of this process."""
    before = os.environ.get(SAFE_PATH)
    os.environ[SAFE_PATH] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ[SAFE_PATH]
        else:
            os.environ[SAFE_PATH] = before


@contextmanager
def _dask(address: str) -> Iterator[Executor]:
    if not _ADDRESS.fullmatch(address):
        raise BadInput(f"scheduler {address!r} must be an address such as tcp://127.0.0.1:8786")
    distributed = import_optional("distributed", "a scheduler")
    try:
        client = distributed.Client(address, timeout=ANSWER, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise BadInput(f"the scheduler at {address} does not answer within {ANSWER:g} s ({reason})") from None
    with client, client.get_executor(pure=False, retries=3) as executor:
        yield executor
