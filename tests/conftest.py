"""Settings for all tests: tiers, groups for parallel workers, and fixtures without side effects.

Tiers (the last line of a run says which were left out and how to run them):

* ``quick``      everything that compiles nothing and is not marked ``slow``; ``pytest -m quick``
* ``compiled``   runs numba kernels; the argument names a group (see ``tests/specs.py``)
* ``validate``   long statistical checks; ``pytest --validate``
* ``browser``    ``tests/browser``, the page in Chromium; ``pytest tests/browser``
* ``peers``      ``tests/peers``, other programs; ``pytest tests/peers``
"""

from __future__ import annotations

import compileall
import gc
import signal
import warnings
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings
from matplotlib.figure import Figure
from numba.core.config import DISABLE_JIT
from numba.core.event import Event, Listener, register

# Numba's cache tells functions loaded from bytecode from the same functions loaded from source: all processes of a
# run, workers and children, must load them in the same way, or they compile everything twice.
compileall.compile_dir(Path(__file__).parents[1] / "src", quiet=2)

from sand.compiler.ahead import share_compilation  # noqa: E402

from .specs import FIXTURES, SPECS, STARTS, WORKERS  # noqa: E402
from .validation import BoundRecorder, Recorder, parse_part, part_of, recorded, without_group  # noqa: E402

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as in a background job of a shell; tests send SIGINT
    signal.signal(signal.SIGINT, signal.default_int_handler)

gc.set_threshold(20_000, 10, 10)  # looking for garbage often costs a tenth of a run

TESTS = Path(__file__).parent
FOLDERS = ("browser", "peers")
"""Folders under tests/ that run only when their path is given."""
HOW_TO_RUN = {"browser": "the page in a browser: pytest tests/browser", "peers": "other programs: pytest tests/peers"}
left_out: Counter[str] = Counter()
recording = pytest.StashKey[Recorder]()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--validate", action="store_true", help="also run the long statistical checks")
    parser.addoption(
        "--validate-part",
        metavar="K/N",
        type=parse_part,
        help="run only the long checks of part K (0 … N-1) of N, and no other tests",
    )
    parser.addoption(
        "--record", metavar="FILE", type=Path, help="write numbers beside their bounds to a table (tests/validation.py)"
    )


def pytest_configure(config: pytest.Config) -> None:
    if hasattr(config, "workerinput"):  # workers of pytest-xdist share the cores
        share_compilation()
    # the same examples in every run: no test fails by chance
    settings.register_profile("fixed", max_examples=100 if config.getoption("--validate") else 30, derandomize=True)
    settings.load_profile("fixed")
    if config.getoption("--record") and not hasattr(config, "workerinput"):
        config.stash[recording] = Recorder(config.getoption("--record"))
        config.pluginmanager.register(config.stash[recording])


def _tier(item: pytest.Item) -> str | None:
    """The tier of a test beyond the default ones, or None."""
    if "validate" in item.keywords:
        return "validate"
    folder = item.path.relative_to(TESTS).parts[0] if item.path.is_relative_to(TESTS) else ""
    return folder if folder in FOLDERS else None


def _chosen(config: pytest.Config) -> set[str]:
    """The tiers that this run includes."""
    roots = [Path(str(word).split("::")[0]).resolve() for word in config.args]
    chosen = {name for name in FOLDERS if any(root.is_relative_to(TESTS / name) for root in roots)}
    if config.getoption("--validate") or config.getoption("--validate-part"):
        chosen.add("validate")
    return chosen


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    if collection_path.parent == TESTS and collection_path.name in FOLDERS:
        return collection_path.name not in _chosen(config) or None
    return None


@pytest.hookimpl(tryfirst=True)  # before `-m` and pytest-xdist look at the marks
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    chosen, part = _chosen(config), config.getoption("--validate-part")
    if config.getoption("--record") and not any("[" in str(word) for word in config.args):
        _note_cases(config, [item.nodeid for item in items if "record_bound" in getattr(item, "fixturenames", ())])
    kept, dropped = [], []
    for item in items:
        tier = _tier(item)
        wanted = tier is None or tier in chosen
        if part:
            wanted = tier == "validate" and part_of(item.nodeid, part)
        if wanted:
            kept.append(item)
        else:
            dropped.append(item)
            left_out[tier or "default"] += 1
        _mark(item, tier)
    if dropped:
        config.hook.pytest_deselected(items=dropped)
        items[:] = kept
    if hasattr(config, "workerinput"):
        items.sort(key=_start)


def _note_cases(config: pytest.Config, names: list[str]) -> None:
    """Tell the recorder, in a worker of pytest-xdist that of the reporting process, which cases there are."""
    if hasattr(config, "workerinput"):
        config.workeroutput["cases"] = names
    else:
        config.stash[recording].cases.update(names)


def _start(item: pytest.Item) -> int:
    """When workers of pytest-xdist start the group of a test."""
    group = item.get_closest_marker("xdist_group")
    return STARTS.index(group.args[0]) if group else len(STARTS)


def _mark(item: pytest.Item, tier: str | None) -> None:
    """Add `quick` or the group of the pytest worker that compiles the test's kernels."""
    for name in FIXTURES.keys() & set(getattr(item, "fixturenames", ())):
        if item.get_closest_marker("compiled") is None:
            item.add_marker(pytest.mark.compiled(FIXTURES[name]))
    mark = item.get_closest_marker("compiled")
    if tier is not None:  # only default tests expect all of their warnings
        item.add_marker(pytest.mark.filterwarnings("default"), append=False)
    if mark is None and tier is None and "slow" not in item.keywords:
        item.add_marker(pytest.mark.quick)
    if mark is not None:
        if not mark.args or not set(mark.args) <= set(SPECS):
            raise pytest.UsageError(f"{item.nodeid}: compiled{mark.args} must name some of {', '.join(SPECS)}")
        item.add_marker(pytest.mark.xdist_group(WORKERS.get(mark.args[0], mark.args[0])))


# ---- what a test may compile -------------------------------------------------------------------------
class CompilationGuard(Listener):
    """Fails a test without the mark `compiled` that compiles a kernel, or makes the stages of a simulation."""

    def __init__(self) -> None:
        self.allowed, self.has_compiled = True, False

    def on_start(self, event: Event) -> None:
        """Called by numba before it compiles a function."""
        if not self.allowed:
            function = getattr(event.data.get("dispatcher"), "py_func", None)
            raise AssertionError(f"this test compiles {getattr(function, '__qualname__', function)}: {ADVICE}")

    def on_end(self, event: Event) -> None:
        """Called by numba after it compiled a function."""
        self.has_compiled = True


ADVICE = "mark it with pytest.mark.compiled(group), or as a long check (see tests/specs.py)"
guard = CompilationGuard()
register("numba:compile", guard)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    guard.allowed = _tier(item) is not None or bool(DISABLE_JIT) or item.get_closest_marker("compiled") is not None
    result = yield
    guard.allowed = True
    if guard.has_compiled:  # what the compiler leaves stays to the end; garbage of the test does not
        gc.collect()
        gc.freeze()
        guard.has_compiled = False
    return result


def pytest_collection_finish() -> None:
    """The collected tests and all modules, millions of objects, stay: the search for garbage passes over them."""
    gc.collect()
    gc.freeze()


# ---- the last line -----------------------------------------------------------------------------------
def pytest_sessionfinish(session: pytest.Session) -> None:
    output = getattr(session.config, "workeroutput", None)
    if output is not None:  # a worker of pytest-xdist sends it to the reporting process
        output["left_out"] = dict(left_out)


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    output = getattr(node, "workeroutput", {})
    left_out.clear()  # every worker collects the same tests
    left_out.update(output.get("left_out", {}))
    if recording in node.config.stash:
        node.config.stash[recording].cases.update(output.get("cases", ()))


def pytest_unconfigure(config: pytest.Config) -> None:
    reporter = config.pluginmanager.getplugin("terminalreporter")
    lines = [f"{left_out['validate']} long statistical checks: pytest --validate"] if left_out["validate"] else []
    lines += [HOW_TO_RUN[name] for name in HOW_TO_RUN if name not in _chosen(config)]
    if reporter is not None and not hasattr(config, "workerinput"):
        reporter.write_line("not run: " + "; ".join(lines))


@pytest.fixture
def record_bound(request: pytest.FixtureRequest) -> BoundRecorder:
    """Checks a number against its bounds, and records it: `record_bound("energy error", error, most=1e-6)`."""
    test = without_group(request.node.nodeid).partition("[")[0]
    writes = request.config.getoption("--record") is not None
    return BoundRecorder(request.node.user_properties, None if writes else recorded().get(test, set()))


@pytest.fixture(autouse=True)
def _no_browser(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tests open no windows."""
    monkeypatch.setenv("SAND_NO_BROWSER", "1")


def _draw_nothing(patch: pytest.MonkeyPatch) -> None:
    for name in ("run_figure.run_figure", "collisions.collision_figure", "scattering.sigma_figure"):
        patch.setattr(f"sand.plotting.{name}", lambda *_, **__: Figure(figsize=(1.0, 1.0)))


@pytest.fixture(autouse=True, scope="session")
def _empty_figures() -> Iterator[pytest.MonkeyPatch]:
    """Runs and jobs, also those of fixtures, end with an empty figure, which costs a second less than a real one."""
    with pytest.MonkeyPatch.context() as patch:
        _draw_nothing(patch)
        yield patch


@pytest.fixture(autouse=True)
def _real_figures(request: pytest.FixtureRequest, _empty_figures: pytest.MonkeyPatch) -> Iterator[None]:
    """Tests marked `draws` end with a real figure."""
    draws = "draws" in request.keywords
    if draws:
        _empty_figures.undo()
    yield
    if draws:
        _draw_nothing(_empty_figures)


@pytest.fixture(autouse=True)
def _no_physics_warnings() -> Iterator[None]:
    """Ignore warnings about hot, overlapping and small iron grains; tests of these warnings catch them."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="contacts of .* grains")
        warnings.filterwarnings("ignore", message="moments of .* grains")
        warnings.filterwarnings("ignore", message=r"temperature = .* no material is solid")
        warnings.filterwarnings("ignore", message=r"grains .* overlap by .* there is no sand\.Contact")
        yield
