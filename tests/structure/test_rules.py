"""Rules that keep the structure: order of imports, docstrings, and which packages use numba, files and the network."""

import ast
import graphlib
import re
import shutil
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

import pytest

from .counts import COUNTS
from .layers import LAYERS, PLAN, SOURCE, TOP, rank, written
from .sources import SOURCES, nodes_of, text_of

pytestmark = pytest.mark.xdist_group("sources")
PAGE = sorted((TOP / "grainview" / "src").rglob("*.*"))


def package_of(path: Path) -> str:
    """The package or module directly under `sand` that a file belongs to."""
    return path.relative_to(SOURCE).with_suffix("").parts[0]


def imports(path: Path) -> list[str]:
    """Full names of the modules that a file imports, wherever in the file; `sand.` ones as far as they are modules."""
    package = ["sand", *path.relative_to(SOURCE).parts[:-1]]
    found = []
    for node in nodes_of(path):
        if isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            module = ".".join([*base, *((node.module or "").split(".") if node.module else [])])
            names = [f"{module}.{alias.name}" for alias in node.names]
            found += [name if name in MODULES else module for name in names]
        elif isinstance(node, ast.Import):
            found += [alias.name for alias in node.names]
        elif isinstance(node, ast.Call) and getattr(node.func, "id", getattr(node.func, "attr", "")) == "import_module":
            texts = [arg.value for arg in node.args[:1] if isinstance(arg, ast.Constant)]
            found += [text for text in texts if not text.startswith(".")]
    return found


def name_of(path: Path) -> str:
    """`sand.io.lock` of `src/sand/io/lock.py`."""
    parts = path.relative_to(SOURCE).with_suffix("").parts
    return ".".join(["sand", *(parts[:-1] if parts[-1] == "__init__" else parts)])


MODULES = {name_of(path): path for path in SOURCES}


@pytest.mark.slow
def test_imports_go_one_way():
    """A package imports only from packages above it in `layers.LAYERS`, also within functions and for types."""
    wrong = [
        f"{path.relative_to(SOURCE)} imports {name}"
        for path in SOURCES
        for name in imports(path)
        if name.startswith("sand.") or name == "sand"
        if (other := [*name.split("."), ""][1]) != package_of(path)
        and rank(other) >= rank(package_of(path))
        and rank(package_of(path)) < len(LAYERS)
    ]
    assert not wrong, wrong


@pytest.mark.slow
def test_no_circular_imports():
    """Sorting all modules by their imports succeeds; `graphlib` raises CycleError, with the cycle, otherwise."""
    graph = {name: {other for other in imports(path) if other in MODULES} for name, path in MODULES.items()}
    order = list(graphlib.TopologicalSorter(graph).static_order())
    assert len(order) == len(MODULES)


def test_every_package_has_a_documented_layer():
    """A new package or top-level module needs a row of `layers.LAYERS`; ARCHITECTURE.md has the same table."""
    names = {package_of(path) for path in SOURCES} - {"__init__", "__main__"}
    assert names == {name for row in LAYERS for name in row}
    assert PLAN.read_text("utf-8") == written(), "run: python -m tests.structure.layers"


@pytest.mark.slow
def test_public_names_have_docstrings():
    """Modules, and public classes, functions and methods with more than one statement."""
    silent = []
    for path in SOURCES:
        nodes = nodes_of(path)
        if not ast.get_docstring(nodes[0]):
            silent.append(str(path.relative_to(TOP)))
        for parent in nodes:
            if not isinstance(parent, (ast.Module, ast.ClassDef)):
                continue
            for node in parent.body:
                public = isinstance(node, (ast.FunctionDef, ast.ClassDef)) and not node.name.startswith("_")
                private_home = isinstance(parent, ast.ClassDef) and parent.name.startswith("_")
                if public and not private_home and not ast.get_docstring(node) and len(node.body) > 1:
                    silent.append(f"{path.relative_to(TOP)}: {node.name}")
    assert not silent, silent


def test_the_installed_numba_is_a_tested_version():
    """An untested numba takes longer to compile: test `compiler/` with it, then raise jit.TESTED_NUMBA."""
    import numba

    from sand.compiler import jit

    assert jit.TESTED_NUMBA[0] <= numba.version_info.short <= jit.TESTED_NUMBA[1]
    assert jit._KERNEL and jit._FUNCTION  # the reduced compilation of `lowering`


@pytest.mark.slow
def test_numba_is_imported_in_one_package():
    """numba and llvmlite are imported in `compiler/` only."""
    wrong = [
        f"{path.relative_to(SOURCE)} imports {name}"
        for path in SOURCES
        if package_of(path) != "compiler"
        for name in imports(path)
        if name.split(".")[0] in ("numba", "llvmlite")
    ]
    assert not wrong, wrong


@pytest.mark.slow
def test_only_io_opens_files_and_only_cli_prints():
    """`open`, `read_text`, `write_text` are called in io/ and compiler/ alone; print in cli/ and compiler/progress."""
    for path in SOURCES:
        package = package_of(path)
        for node in nodes_of(path):
            if not isinstance(node, ast.Call):
                continue
            name = getattr(node.func, "id", None) or getattr(node.func, "attr", None)
            where = f"{path.relative_to(TOP)}:{node.lineno} calls {name}"
            if name == "print" or (name == "echo" and isinstance(node.func, ast.Attribute)):
                assert package == "cli" or path == SOURCE / "compiler" / "progress.py", where
            if name in {"read_text", "write_text", "read_bytes", "write_bytes"} or (
                isinstance(node.func, ast.Name) and name == "open"
            ):
                assert package in ("io", "compiler"), where


def loads_of_numpy(nodes: Iterable[ast.AST]) -> list[ast.Call]:
    """Calls of `numpy.load`, under any name that the module imports."""
    modules, functions = set(), set()
    for node in nodes:
        if isinstance(node, ast.Import):
            modules |= {alias.asname or alias.name for alias in node.names if alias.name == "numpy"}
        elif isinstance(node, ast.ImportFrom) and node.module == "numpy":
            functions |= {alias.asname or alias.name for alias in node.names if alias.name == "load"}
    calls = [node for node in nodes if isinstance(node, ast.Call)] if modules or functions else []
    return [
        call
        for call in calls
        if getattr(call.func, "id", None) in functions
        or (getattr(call.func, "attr", None) == "load" and getattr(call.func.value, "id", None) in modules)
    ]


def refuses_pickles(call: ast.Call) -> bool:
    """Whether a call passes allow_pickle=False."""
    return any(word.arg == "allow_pickle" and getattr(word.value, "value", None) is False for word in call.keywords)


def test_calls_that_load_arrays_are_found():
    """Checks the helper of the next test: calls under other names, and calls that allow pickles."""
    text = (
        "import numpy\nimport numpy as np\nfrom numpy import load as get\nnp.load(a)\nnumpy.load(b, allow_pickle=x)\n"
    )
    found = loads_of_numpy([*ast.walk(ast.parse(text + "get(c, allow_pickle=False)\nother.load(d)\nload(e)\n"))])
    assert [ast.unparse(call.args[0]) for call in found] == ["a", "b", "c"]
    assert [refuses_pickles(call) for call in found] == [False, False, True]


@pytest.mark.slow
def test_no_pickle_no_network():
    """No pickle, and no sockets except in the server of `sand view`; NumPy files with allow_pickle=False."""
    server = SOURCE / "viewer" / "server.py"
    network = {"socket", "socketserver", "urllib", "requests", "http", "asyncio", "aiohttp", "ssl"}
    loads = []
    for path in SOURCES:
        names = {name.split(".")[0] for name in imports(path) if name != "urllib.parse"}  # it opens nothing
        assert not names & {"pickle", "dill", "cloudpickle"}, path
        assert not names & (network - {"http", "socketserver"} if path == server else network), path
        loads += [(path, call) for call in loads_of_numpy(nodes_of(path))]
    assert loads
    assert not [f"{path.relative_to(TOP)}:{call.lineno}" for path, call in loads if not refuses_pickles(call)]


def test_bounds_of_tests_state_their_absolute_part():
    """Every `approx` states `abs`: the default of pytest, 1e-12, is larger than most SI quantities of grains."""
    calls = [
        (path, node)
        for path in sorted((TOP / "tests").rglob("*.py"))
        if "approx" in text_of(path)
        for node in nodes_of(path)
        if isinstance(node, ast.Call) and getattr(node.func, "attr", getattr(node.func, "id", "")) == "approx"
    ]
    silent = [f"{path.relative_to(TOP)}:{call.lineno}" for path, call in calls if "abs" not in named(call)]
    assert calls and not silent


def named(call: ast.Call) -> set[str | None]:
    """Names of the keyword arguments of a call."""
    return {word.arg for word in call.keywords}


def test_help_imports_no_heavy_package():
    """`import sand` and the command line's parser import neither numba nor NumPy nor similar packages."""
    program = (
        "import sys, sand, sand.cli.main\n"
        "heavy = {'numba', 'numpy', 'scipy', 'pydantic', 'matplotlib', 'gsd', 'pint'} & set(sys.modules)\n"
        "print(sorted(heavy))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.slow
def test_building_a_gas_imports_no_unneeded_package():
    """Packages that are slow to import are imported only when they are needed."""
    program = (
        "import sys, sand\n"
        "gas = sand.setup.gas(8, '0.5 um', radius='10 nm', material='iron', moment='200 A m^2/kg')\n"
        "sand.Simulation(gas, [sand.Contact(), sand.Dipoles()], box='0.5 um')\n"
        "heavy = {'scipy.sparse', 'scipy.spatial', 'matplotlib', 'gsd', 'pint', 'tqdm'} & set(sys.modules)\n"
        "print(sorted(heavy))"
    )
    done = subprocess.run([sys.executable, "-W", "ignore", "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def without_comments(text: str) -> str:
    """TypeScript or CSS without comments; `//` after a colon belongs to an address."""
    return re.sub(r"/\*.*?\*/|(?<!:)//[^\n]*", "", text, flags=re.DOTALL)


def test_comments_are_distinguished_from_addresses():
    """Checks the helper of the next test: `//` of an address is no comment."""
    assert without_comments("a /* http://b\n */ c // https://d\ne") == "a  c \ne"
    assert "http://b" in without_comments('fetch("http://b"); // of https://c')


def test_size_limits_of_the_page_sources():
    """TypeScript: files under 300 lines, lines of at most 120 characters."""
    scripts = [path for path in PAGE if path.suffix == ".ts"]
    assert scripts
    for path in scripts:
        lines = path.read_text("utf-8").splitlines()
        assert len(lines) < 300, path.relative_to(TOP)
        wide = [number for number, line in enumerate(lines, 1) if len(line) > 120]
        assert not wide, f"{path.relative_to(TOP)}: lines {wide}"


def test_the_page_needs_no_network():
    """No address of another machine except XML namespaces such as http://www.w3.org/2000/svg."""
    for path in PAGE:
        strangers = re.findall(
            r"(?:https?|wss?)://(?!www\.w3\.org/)[^\s\"'`)]*", without_comments(path.read_text("utf-8"))
        )
        assert not strangers, f"{path.relative_to(TOP)}: {strangers}"


def tracked_files() -> list[str]:
    """Files in git; skips the test where there is no checkout, as in an unpacked source archive."""
    if not (TOP / ".git").exists() or shutil.which("git") is None:
        pytest.skip("not a git checkout")
    words = ["git", "ls-files"]
    return subprocess.run(words, cwd=TOP, capture_output=True, encoding="utf-8", check=True).stdout.splitlines()


def test_nothing_built_is_in_git():
    """Neither the page bundle nor npm packages."""
    built = [n for n in tracked_files() if n.startswith("src/sand/viewer/page/") or "node_modules/" in n]
    assert not built, built


def test_no_large_files():
    """No file above 300 kB in git."""
    large = [n for n in tracked_files() if (TOP / n).is_file() and (TOP / n).stat().st_size > 300_000]
    assert not large, large


@pytest.mark.slow
def test_the_source_archive_is_complete():
    """All files in git are in the sdist, so that its tests run and its docs build."""
    sdist = pytest.importorskip("hatchling.builders.sdist", reason="the build backend is not installed")
    names = {file.distribution_path for file in sdist.SdistBuilder(str(TOP)).recurse_included_files()}
    missing = {name for name in tracked_files() if (TOP / name).is_file()} - {name.replace("\\", "/") for name in names}
    assert not missing, sorted(missing)


@pytest.mark.parametrize("count", COUNTS, ids=[count.what for count in COUNTS])
def test_the_source_becomes_no_more_interwoven(count):
    """Each count is at most its limit (`counts`), which is lowered as counts fall."""
    assert count.now() <= count.most, f"{count.what}: {count.now()}, at most {count.most}"
