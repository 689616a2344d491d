"""The scripts and cells of README and docs run, and README states what its script prints."""

import os
import re
import runpy
import sys
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import pytest

from sand.integrate.registry import INTEGRATORS

quoted = pytest.importorskip("benchmarks.quoted", reason="benchmarks are not beside the tests")
from benchmarks import page_code  # noqa: E402

EXECUTED = [page for page in page_code.PAGES if page_code.cells(page)]
FIRST = quoted.TOP / "docs" / "start.md"
GALLERY = sorted((quoted.TOP / "examples" / "gallery").rglob("*.py"))
SCRIPTS = [(page, k) for page in page_code.PAGES for k in range(len(page_code.scripts(page)))]


@pytest.fixture
def as_docs(tmp_path, monkeypatch):
    """Surroundings of the pages: an empty folder, the `sand` command, pictures that nobody sees."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SAND_EXAMPLES", str(quoted.TOP / "examples"))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(quoted.TOP / "src"), os.environ.get("PYTHONPATH", "")]))
    monkeypatch.setenv("PATH", os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]]))
    matplotlib.use("Agg")
    yield
    plt.close("all")
    INTEGRATORS.pop("forest-ruth", None)  # which a page registers


def shortened(code: str) -> str:
    """Code of the README and the first page with runs of a fifteenth of the time."""
    return re.sub(r'until="(\d[\d.]*) us"', lambda found: f'until="{float(found[1]) / 15:.4f} us"', code)


def form(text: str) -> str:
    """Text with every number replaced by #."""
    return re.sub(r"\d+(?:\.\d+)?(?:e[+-]\d+)?", "#", text.strip())


def test_shorter_runs():
    """Checks the helper: times until which a run lasts, and only those."""
    assert shortened('box("1.2 um"); run(until="5 us")') == 'box("1.2 um"); run(until="0.3333 us")'
    assert form("5e-06 s after 9885 steps, drift 0.0004") == "# s after # steps, drift #"


@pytest.mark.filterwarnings("ignore:grains in contact vibrate", "ignore:wrote .* but no browser could be opened")
@pytest.mark.compiled("dipoles")
@pytest.mark.parametrize("page, k", SCRIPTS, ids=lambda x: getattr(x, "stem", x))
def test_scripts(page, k, as_docs, capsys):
    """Each whole script of README and docs runs, shortened; that of README prints a line of the form that it shows."""
    page_code.run_cells([shortened(page_code.scripts(page)[k])])
    printed = capsys.readouterr().out
    if page.name == "README.md":
        assert form(printed) == form(quoted.quotable()["script"]["printed"])


@pytest.mark.filterwarnings("ignore:grains in contact vibrate")
@pytest.mark.compiled("dipoles")
def test_first_page(as_docs, capfd):
    """The cells of the first page run one after the other, shortened; commands print what they did."""
    page_code.run_cells([shortened(code) for code in page_code.cells(FIRST)])
    printed = capfd.readouterr().out
    assert "exit code 2" in printed and "temprature" in printed and "contacts formed: " in printed


@pytest.mark.validate
@pytest.mark.compiled("dipoles")
def test_readme_prints_its_result(as_docs, capsys):
    """5 µs, steps and drift of README are those of its script up to the choice of the processor's last digits.

    Grains that meet differently change both as another seed does.  Steps of twelve seeds have a standard deviation of
    5 % of their mean; two runs differ by at most 30 %, four standard deviations of the difference.  The drift is stated
    with one digit and stays below 1e-3, a tenth of a percent.
    """
    (code,) = page_code.scripts(quoted.TOP / "README.md")
    page_code.run_cells([code])
    numbers = [
        re.findall(r"[\d.]+(?:e-\d+)?", text)
        for text in (capsys.readouterr().out, quoted.quotable()["script"]["printed"])
    ]
    (time, steps, drift), (time_said, steps_said, drift_said) = ([float(x) for x in line] for line in numbers)
    assert time == time_said == 5e-6
    assert steps == pytest.approx(steps_said, rel=0.3, abs=0.0)
    assert max(drift, drift_said) < 1e-3


@pytest.mark.validate
@pytest.mark.compiled("dipoles")
@pytest.mark.parametrize("page", EXECUTED, ids=lambda page: page.stem)
def test_pages(page, as_docs):
    """The cells of every page run one after the other; many end in assertions."""
    page_code.run_cells(page_code.cells(page))


@pytest.mark.validate
@pytest.mark.compiled("dipoles")
@pytest.mark.parametrize("script", GALLERY, ids=lambda script: script.stem)
def test_gallery(script, as_docs):
    """Every script of the gallery runs, draws something, and says what to change."""
    code = script.read_text("utf-8")
    assert "# What to change\n" in code
    runpy.run_path(str(script))
    assert plt.get_fignums() or list(Path.cwd().glob("*/*.png"))
