"""Executors of experiments: this process, worker processes, or a dask cluster."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import re
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager
from functools import partial
from multiprocessing.connection import wait
from queue import Empty, SimpleQueue
from typing import Any

from ..basics.errors import BadInput, import_optional, warn
from ..basics.version import __version__
from ..compiler.program import before_first_calls
from ..forces.own import IMPORTED
from ..simulation.signals import STOPS
from .worker import LONGEST_STOP, SHIELDED, STOPPED, Item, Result, begin_worker, do_task, done_apart

ANSWER = 10.0
"""Timeout of the connection to a scheduler [s]."""
LOOK = 0.5
"""Wall time [s] between two looks for a signal whose exception an import or the compiler has lost."""
MOST_ON_WINDOWS = 61
"""Largest number of processes of a pool on Windows, a limit of `concurrent.futures`."""
SAFE_PATH = "PYTHONSAFEPATH"
"""Environment variable by which Python leaves the current folder out of its path."""
_ENVIRONMENT = threading.RLock()
"""Held while the environment is that of new processes: several threads may start some."""
_ADDRESS = re.compile(r"(tcp|tls|ws|wss|ucx)://[^\s:/]+:\d{1,5}")


@contextmanager
def executor_for(
    workers: int = 1, scheduler: str | None = None, threads: int | None = None
) -> Iterator[Executor | None]:
    """Context manager of an executor; None for a single worker, which is this process.

    An exception in the block, also Ctrl-C or the death of a worker, stops all worker processes: no task begins after
    it, and runs that write files end with a checkpoint. Workers do the same when this process dies. Tasks that a dask
    worker has begun go on to their end, all others are cancelled.

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
        with starting_processes():  # the first lock of a pool starts a process, too
            pool = _Pool(workers, threads or 1)
        with pool:
            try:
                pool.start(workers)
                yield pool
            except BaseException:
                pool.stop()
                raise


def results_of(
    executor: Executor | None, work: Callable[[Item], Result], items: Sequence[Item]
) -> Iterator[tuple[Item, Result]]:
    """Pairs of item and `work(item)`, in order of completion; warnings of other processes are issued in this one.

    Parameters
    ----------
    executor : Executor or None
        Any `concurrent.futures.Executor`; None works through the items in this process, in their order.

    Raises
    ------
    BadInput
        If a worker lacks the package.
    """
    if executor is None:
        for item in items:
            _look_for_signals()
            yield item, work(item)
        return
    waiting = {executor.submit(done_apart, os.getpid(), work, item): item for item in items}
    done = SimpleQueue[Future[Any]]()
    try:
        for future in waiting:
            future.add_done_callback(done.put)
        for _ in waiting:
            future = _next(done)
            try:
                result, warnings = future.result()
            except Exception as error:
                if problem := _without_package(error):
                    raise BadInput(problem) from None
                raise
            for text in warnings:
                warn(text)
            yield waiting[future], result
    finally:
        for future in waiting:
            future.cancel()


def _without_package(error: BaseException) -> str:
    """The message for a worker, or a scheduler, that cannot read a task because it lacks SAND; "" for other errors."""
    each: BaseException | None = error
    while each is not None:
        is_missing = isinstance(each, ModuleNotFoundError) and str(each.name).partition(".")[0] == "sand"
        if is_missing or "deserialization of the task graph" in str(each):
            return f"a worker or the scheduler lacks the package sand; install sand-dust {__version__} there"
        each = each.__cause__ or each.__context__
    return ""


def _next(done: SimpleQueue[Future[Any]]) -> Future[Any]:
    """The next task that is done."""
    while True:
        _look_for_signals()
        with contextlib.suppress(Empty):
            return done.get(timeout=LOOK)


def _look_for_signals() -> None:
    """Raise KeyboardInterrupt again if an import or the compiler, which call Python from C, has lost it."""
    for check in before_first_calls:
        check()


class _Pool(ProcessPoolExecutor):
    """Worker processes that end with this process, and after the task that a signal stops."""

    def __init__(self, workers: int, threads: int):
        begin = partial(begin_worker, threads, list(IMPORTED))
        super().__init__(workers, mp_context=multiprocessing.get_context("spawn"), initializer=begin)
        self._workers = self._processes  # the base class drops its own
        self._has_started, self._threads, self._number = False, threads, workers

    def submit(self, work: Callable[..., Any], /, *given: Any, **named: Any) -> Future[Any]:
        """Submit a task; starts a process if there are fewer than `workers`."""
        with starting_processes():
            return super().submit(do_task, work, *given, **named)

    def start(self, workers: int) -> None:
        """Start all processes, and wait until they are ready."""
        for future in [self.submit(int) for _ in range(workers)]:
            future.result()
        self._has_started = True

    def renew(self) -> dict[int, str]:
        """Start all processes again after one has died; returns how it, or several, ended, by process id."""
        processes = list(self._workers.values())
        self.stop()
        dead = {one.pid: one.exitcode for one in processes if one.exitcode not in (None, 0, STOPPED)}
        with starting_processes():
            self.__init__(self._number, self._threads)  # type: ignore[misc]
        self.start(self._number)
        return {pid: _end_of(code) for pid, code in dead.items() if code != -signal.SIGTERM}  # type: ignore[misc]

    def stop(self) -> None:
        """Stop all processes; a process that runs a simulation with files writes a checkpoint first."""
        manager: Any = self._executor_manager_thread
        self.shutdown(wait=False, cancel_futures=True)
        processes = list(self._workers.values())
        with _only_ctrl_c():
            try:
                for process in processes if self._has_started else ():
                    process.terminate()
                left = {process.sentinel for process in processes} if self._has_started else set()
                while left and (ended := wait(left, LONGEST_STOP)):
                    left -= set(ended)
            finally:  # also after a second Ctrl-C
                for process in processes:
                    process.kill()
                if manager is not None:  # at the end of the program it must not be at work
                    manager.join(LONGEST_STOP)


def _end_of(code: int) -> str:
    """How a process ended, in words, from its exit code."""
    try:
        return f"by {signal.Signals(-code).name}" if code < 0 else f"with exit code {code}"
    except ValueError:
        return f"by signal {-code}"


@contextmanager
def _only_ctrl_c() -> Iterator[None]:
    """In the block, which runs after a first signal, only Ctrl-C interrupts: other signals may be sent repeatedly."""
    before = {}
    if threading.current_thread() is threading.main_thread():
        before = {number: signal.signal(number, signal.SIG_IGN) for number in set(STOPS) - {signal.SIGINT}}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def starting_processes() -> Iterator[None]:
    """In the block new processes begin without the current folder on their path, and with blocked signals.

    A terminal or a batch system sends signals to all processes; workers wait for the one of this process instead.
    Later they get the path of this process.
    """
    can_block = hasattr(signal, "pthread_sigmask")
    with _ENVIRONMENT:
        before = os.environ.get(SAFE_PATH)
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, {*SHIELDED, signal.SIGTERM}) if can_block else set()
        os.environ[SAFE_PATH] = "1"
        try:
            yield
        finally:
            if before is None:
                del os.environ[SAFE_PATH]
            else:
                os.environ[SAFE_PATH] = before
            if can_block:
                signal.pthread_sigmask(signal.SIG_SETMASK, mask)


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
        try:
            yield executor
        except BaseException:
            with contextlib.suppress(Exception):  # a scheduler that no longer answers
                executor.shutdown(wait=False)  # cancels what has not begun, and waits for nothing
            raise
