"""Signals that arrive while code is compiled, linked or loaded are handled afterwards."""

import os
import signal
import subprocess
import sys
import threading
import time

import pytest

from sand.compiler.jit import COMPILED
from sand.compiler.uninterrupted import uninterrupted
from sand.simulation.signals import Signals

from ...systems import stops_others


def test_signals_wait_for_the_end_of_the_block():
    """A first Ctrl-C is handled at the end of the block, before what follows it; then the handler is the one before."""
    before, done = signal.getsignal(signal.SIGINT), []
    with pytest.raises(KeyboardInterrupt):
        with uninterrupted():
            signal.raise_signal(signal.SIGINT)
            done.append("block")
        done.append("after")
    assert done == ["block"] and signal.getsignal(signal.SIGINT) is before


def test_a_second_ctrl_c_interrupts_at_once():
    """Also where a run records the first one; both handlers before the blocks are there again."""
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt), Signals() as signals, uninterrupted():
        signal.raise_signal(signal.SIGINT)
        assert signals.received is None
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)
        time.sleep(5.0)
        raise AssertionError("not interrupted")
    assert signal.getsignal(signal.SIGINT) is before


def test_blocks_within_blocks_and_decorators():
    """The outermost block handles the signal, once."""
    with Signals() as signals:

        @uninterrupted()
        def inner():
            signal.raise_signal(signal.SIGINT)

        with uninterrupted():
            inner()
            assert signals.received is None
        assert signals.received == signal.SIGINT


def test_other_threads():
    """Python handles signals in the main thread: a block in another one changes no handler."""
    before, found = signal.getsignal(signal.SIGINT), []

    def block():
        with uninterrupted():
            found.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=block)
    thread.start()
    thread.join()
    assert found == [before]


PROGRAM = """
import signal
import sys

import numpy as np
from llvmlite.binding import ffi
from numba.core import codegen

place = sys.argv[1]
raised = []
getbuffer, detach = codegen.JITCodeLibrary._object_getbuffer_hook.__func__, ffi.ObjectRef.detach


def interrupt(where):
    if where == place and not raised:
        raised.append(where)
        signal.raise_signal(signal.SIGINT)


def load(cls, module):  # LLVM asks for the content of code from the cache
    interrupt("loaded")
    return getbuffer(cls, module)


def link(self):  # two modules are linked, and Python has not noted it
    if sys._getframe(1).f_code.co_name == "link_modules":
        interrupt("linked")
    return detach(self)


codegen.JITCodeLibrary._object_getbuffer_hook = classmethod(load)
ffi.ObjectRef.detach = link
import sand
from sand.compiler.stage import stage


@stage("a test")
def count(found):
    found[0] += 1.0
    return 0


found = np.zeros(2)
try:
    count(found)
except KeyboardInterrupt:
    print("interrupted")
count(found)
print(*raised, found[0] >= 1.0)
"""


@stops_others
@pytest.mark.skipif(not COMPILED, reason="nothing is compiled")
@pytest.mark.parametrize("place", ["linked", "loaded"])
def test_interrupted_in_a_callback_of_the_compiler(tmp_path, place):
    """Ctrl-C while modules are linked, or code is loaded from the cache: an exception, and the next call works.

    An exception in these callbacks ends the process with a segmentation fault.
    """
    program, environment = tmp_path / "program.py", {**os.environ, "SAND_CACHE": str(tmp_path / "cache")}
    program.write_text(PROGRAM)
    if place == "loaded":
        subprocess.run([sys.executable, program, "nowhere"], env=environment, check=True, capture_output=True)
    done = subprocess.run([sys.executable, program, place], env=environment, capture_output=True, text=True)
    assert done.returncode == 0, (done.returncode, done.stderr)
    assert done.stdout.split() == ["interrupted", place, "True"]
