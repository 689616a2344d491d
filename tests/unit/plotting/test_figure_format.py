"""Width and style of figures, and grids of panels."""

import io
import json

import matplotlib
import numpy as np
import pytest
from PIL import Image

import sand
from sand.basics.errors import BadInput
from sand.cli.main import main
from sand.experiments.laboratory_figure import laboratory_figure
from sand.plotting.figure_format import figure_format, figure_size, format_width, panel_grid, width_in_inches
from sand.plotting.papers import Curve, Panel, panels_figure
from sand.plotting.render.still import still_picture
from sand.plotting.run_figure import figure_bytes, run_figure
from sand.plotting.style import plot_style, points

from ..synthetic_frames import frame_of


@pytest.mark.parametrize(("text", "inches"), [("3.4in", 3.4), ("8.636 cm", 3.4), ("86.36mm", 3.4), ("245.718pt", 3.4)])
def test_widths(text, inches):
    """1 in = 2.54 cm = 25.4 mm = 72.27 points of TeX, to rounding."""
    assert width_in_inches(text) == pytest.approx(inches, rel=1e-12, abs=0.0)


def test_a_width_is_that_of_the_file():
    """A PNG at 100 pixels per inch of 3.4 inches has 340 columns, whatever the number of panels; panels that would be
    narrower than 2.9 inches are below each other: 1, 2 and 3 columns in 3.4, 7 and 10 inches."""
    x = np.arange(3.0)
    panels = [Panel("x", "y", [Curve("c", x, x)], log="")] * 3
    for width, columns in (("3.4in", 1), ("7in", 2), ("10in", 3)):
        with figure_format(width=width):
            figure = panels_figure(panels, "a title that is longer than the figure is wide " * 3)
            picture = Image.open(io.BytesIO(figure_bytes(figure, dpi=100)))
        left = {round(axes.get_position().x0, 1) for axes in figure.axes if axes.get_xlabel()}
        assert picture.width == round(100 * width_in_inches(width))
        assert len(left) == columns
        with plot_style():
            title = figure.texts[0].get_window_extent()
        assert title.x1 <= figure.bbox.width
    assert format_width() is None and figure_size(5.0, 2.0) == (5.0, 2.0)
    assert panel_grid(3, (4.0, 2.0), 2) == (2, 2, (8.0, 4.0))


def test_a_style_file(tmp_path):
    """Settings of the file hold in the block; font sizes are in proportion to font.size; figsize gives the width."""
    path = tmp_path / "journal.mplstyle"
    path.write_text("font.size: 12\nfont.family: serif\nfigure.figsize: 3, 2\nbackend: agg\n")
    before = dict(matplotlib.rcParams)
    with figure_format(style=path), plot_style():
        assert matplotlib.rcParams["font.family"] == ["serif"]
        assert matplotlib.rcParams["legend.fontsize"] == pytest.approx(7.5 * 12 / 8, rel=1e-12, abs=0.0)
        assert points(10.0) == pytest.approx(15.0, rel=1e-12, abs=0.0)
        assert figure_size(6.0, 3.0) == (3.0, 1.5)
    with figure_format(width="4in", style=path):
        assert figure_size(6.0, 3.0) == (4.0, 2.0)
    assert dict(matplotlib.rcParams) == before and format_width() is None


def test_wrong_widths_and_styles(tmp_path):
    """One line for each problem, all together; wrong lines of a style file with their number."""
    path = tmp_path / "wrong.mplstyle"
    path.write_text("font.size: 12\nfont.colour: red\nlines.linewidth: thick\n")
    with pytest.raises(BadInput) as error, figure_format(width="3.4", style=tmp_path / "none"):
        pass
    assert len(error.value.problems) == 2
    assert error.value.problems[0] == "width = '3.4' must be a width with its unit, such as 3.4in, 8.6cm or 246pt"
    assert "there is no such style file, nor a style of this name in matplotlib" in error.value.problems[1]
    with pytest.raises(BadInput, match=r"font\.colour") as error, figure_format(style=path):
        pass
    assert len(error.value.problems) == 2
    with pytest.raises(BadInput, match="must be from 2in to 20in"), figure_format(width="1 mm"):
        pass


@pytest.mark.slow
@pytest.mark.draws
@pytest.mark.compiled("dipoles")
def test_the_figure_of_a_run_in_a_column(finished_run):
    """In 3.4 inches all panels are within the figure, and no text is below 6 points."""
    simulation = sand.open(finished_run[0]).at(-1)
    wide = run_figure(simulation)
    with figure_format(width="3.4in"):
        narrow = run_figure(simulation)
    assert narrow.get_size_inches()[0] == 3.4 and tuple(wide.get_size_inches()) == (10.0, 6.25)
    assert len(narrow.axes) == len(wide.axes)
    for axes in narrow.axes:
        place = axes.get_position()
        assert 0.0 <= place.x0 < place.x1 <= 1.0 and 0.0 <= place.y0 < place.y1 <= 1.0
    assert min(text.get_size() for axes in narrow.axes for text in axes.texts) >= 6.0


@pytest.mark.slow
def test_a_still_in_a_column():
    """In 3.4 inches at 200 per inch: 680 pixels, texts of at least 6 points; width and size exclude each other."""
    frame = frame_of([[0, 0, 0], [2e-8, 0, 0]], [(0, 1)])
    picture = still_picture(frame, width="3.4in", dpi=200)
    assert picture.image().width == 680
    assert min(text.get_size() for text in picture.texts) >= 6.0
    with pytest.raises(BadInput, match="size and width both set the size"):
        still_picture(frame, width="3.4in", size=(400, 300))


def test_shares_of_each_value_of_a_sweep():
    """Each group has a panel with the shares of what is dissipated, from its own table: 1 for rolling in the first, 1
    for sliding in the second."""
    runs = []
    for group, rolling in (("rate = 1", 1.0), ("rate = 2", 0.0)):
        filling = np.array([0.1, 0.1, 0.2, 0.3])
        table = {"mean_filling": filling, "strain": filling, "time": filling, "filling": filling}
        table |= {"stress": 1e3 * filling, "coordination": 20 * filling, "rate_ratio": 0 * filling}
        shares = {"rolling": rolling, "sliding": 1.0 - rolling, "twisting": 0.0}
        table |= {f"share_{name}": np.full(4, value) for name, value in shares.items()}
        numbers = {"kind": "compress", "grains": 4, "pressure_scale": 1.0, "largest_load": 0.0, "roll_energy": 1e-16}
        runs.append(numbers | {"group": group, "table": {name: list(column) for name, column in table.items()}})
    figure = laboratory_figure(runs)
    panels = [axes for axes in figure.axes if axes.get_ylabel() == "share of what is dissipated"]
    assert [axes.get_legend().get_title().get_text() for axes in panels] == ["rate = 1", "rate = 2"]
    for axes, rolling in zip(panels, (1.0, 0.0), strict=True):
        line = next(one for one in axes.get_lines() if one.get_label() == "rolling")
        np.testing.assert_allclose(line.get_ydata(), rolling, atol=1e-12)


@pytest.mark.compiled("fields")
def test_options_of_commands(run_in_field, tmp_path, capsys):
    """--width and --style of `sand plot`; both wrong: one line each."""
    words = ["plot", str(run_in_field), "--out", str(tmp_path / "there"), "--dpi", "100", "--json"]
    assert main([*words, "--what", "size,still", "--width", "8.636cm"]) == 0
    files = json.loads(capsys.readouterr().out)["files"]
    assert [Image.open(file).width for file in files] == [340, 340]
    assert main(["plot", str(run_in_field), "--width", "3.4", "--style", "nothing"]) == 2
    first, second = capsys.readouterr().err.splitlines()
    assert "--width = '3.4' must be a width with its unit" in first + second
    assert "--style = 'nothing': there is no such style file" in first + second
    assert format_width() is None
