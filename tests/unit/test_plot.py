"""`sand plot`: files made, numbers drawn, refusals that leave nothing behind."""

import json

import numpy as np
import pytest
from PIL import Image

import sand
from sand.analysis.books import Books
from sand.cli.main import main
from sand.core.errors import BadInput
from sand.files.folder import read_ledger
from sand.view.plots import HISTORY, grains_figure, history_figure


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A short run of eight magnetic grains, two of which touch, in a field."""
    place = tmp_path_factory.mktemp("plot") / "run"
    grains = sand.Grains(
        [[2e-8 * 0.998 * (k % 2), 5e-8 * (k // 2), 0.0] for k in range(8)],
        "10 nm",
        sand.SILICA,
        moment=np.tile([0.0, 0.0, 1e-18], (8, 1)),
    )
    grains.arrays.velocity[0] = np.arange(8) * 0.1
    sim = sand.Simulation(
        grains,
        [sand.Contact(), sand.Dipoles(), sand.Field(flux_density="1 mT")],
        box="400 nm",
        out=str(place),
        frame_every="1 ns",
    )
    sim.run(until="3 ns")
    return place


def test_everything_by_default(run, tmp_path, capsys):
    """Five figures over time and a still picture, in DIR/plots, and what was written is told."""
    assert main(["plot", str(run), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["files"]
    assert told == [str(run / "plots" / f"{name}.png") for name in (*HISTORY, "still")]
    assert Image.open(run / "plots" / "still.png").size == (1600, 1000)
    assert main(["plot", str(run)]) == 2
    assert capsys.readouterr().err.count("exists; give another --out, or --overwrite") == 1
    assert main(["plot", str(run), "--overwrite", "--what", "size"]) == 0
    assert main(["info", str(run)]) == 0  # a run's folder is one still


def test_chosen_ones_as_other_formats(run, tmp_path, capsys):
    """Histograms of quantities, a still of a frame in a size of one's own; PDF and SVG are what they are called."""
    out = str(tmp_path / "there")
    words = ["--what", "speed,still", "--size", "300x200", "--frame", "0", "--bonds", "load", "--colour", "alignment"]
    for form, start in (("pdf", b"%PDF"), ("svg", b"<?xml"), ("png", b"\x89PNG")):
        assert main(["plot", str(run), "--out", out, "--format", form, *words, "--dark", "--transparent"]) == 0
        for name in ("speed", "still"):
            assert (tmp_path / "there" / f"{name}.{form}").read_bytes().startswith(start)
    assert Image.open(tmp_path / "there" / "still.png").size == (300, 200)
    assert Image.open(tmp_path / "there" / "still.png").getpixel((298, 2))[3] == 0


def test_a_trajectory_alone(run, tmp_path, capsys):
    """A .gsd has no ledger: a still picture by default, beside it."""
    alone = tmp_path / "alone.gsd"
    alone.write_bytes((run / "trajectory.gsd").read_bytes())
    assert main(["plot", str(alone), "--size", "300x200"]) == 0
    assert [p.name for p in (tmp_path / "alone-plots").iterdir()] == ["still.png"]
    assert main(["plot", str(alone), "--what", "size"]) == 2
    assert "has no ledger; give a run's folder" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--what", "sise,still"], "'sise' is none; did you mean 'size'?"),
        (["--what", ""], "'' is none"),
        (["--colour", "sped"], "there is no quantity 'sped'; did you mean 'speed'?"),
        (["--size", "10x10"], "each must be from 200 to 8000 pixels"),
        (["--size", "wide"], "--size 'wide' must be width x height"),
        (["--view", "botom"], "there is no view 'botom'"),
        (["--view", "0,0,0"], "three numbers that are not all 0"),
        (["--frame", "99"], "has frames 0 to 3, or -1 to -4"),
        (["--cluster", "9"], "cluster 9: there are 4"),
        (["--format", "gif"], "is not one of"),
        (["--out", "/nowhere/at/all"], "cannot be a folder"),
    ],
)
def test_mistakes_are_told_and_nothing_is_written(run, tmp_path, capsys, words, told):
    """One line, exit code 2, no folder."""
    out = [] if "--out" in words else ["--out", str(tmp_path / "there")]
    assert main(["plot", str(run), *out, *words]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1 and told in lines[0]
    assert not list(tmp_path.iterdir())


def test_several_mistakes_have_a_line_each(run, tmp_path, capsys):
    """All at once, not one after the other."""
    assert main(["plot", str(run), "--what", "sise", "--view", "botom", "--size", "1x1", "--colour", "x"]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 4


def test_what_is_not_there(run, tmp_path, capsys):
    """No run, no ledger, a ledger without rows, no frame: told, and nothing is written."""
    assert main(["plot", str(tmp_path)]) == 2
    assert "is not the folder of a run" in capsys.readouterr().err
    (tmp_path / "trajectory.gsd").write_bytes((run / "trajectory.gsd").read_bytes())
    assert main(["plot", str(tmp_path), "--what", "size"]) == 2
    assert "there is no file" in capsys.readouterr().err
    (tmp_path / "ledger.csv").write_text((run / "ledger.csv").read_text().split("\n")[0] + "\n")
    assert main(["plot", str(tmp_path), "--what", "size"]) == 2
    assert "the ledger has no row yet" in capsys.readouterr().err
    (tmp_path / "ledger.csv").write_text("step,time\n0,0.0\n")
    assert main(["plot", str(tmp_path), "--what", "size"]) == 2
    assert "the ledger has no column" in capsys.readouterr().err
    assert not (tmp_path / "plots").exists()
    import gsd.hoomd

    gsd.hoomd.open(str(tmp_path / "trajectory.gsd"), "w").close()
    assert main(["plot", str(tmp_path), "--what", "still"]) == 2
    assert "has no frame yet" in capsys.readouterr().err


def test_books_that_are_read_are_those_that_were_written(run):
    """Drift and columns of ledger.csv are the summary's; curves drawn are the ledger's columns."""
    rows = read_ledger(run / "ledger.csv")
    books = Books(tuple(rows[0]), rows)
    assert books.drift == sand.open(run).summary["drift"]
    for name in HISTORY:
        assert history_figure(books, name, 8, 0.0, dark=name == "size").axes
    axes = history_figure(books, "contacts", 8, 0.0).axes[0]
    for line, column in zip(axes.get_lines(), ("contacts", "made", "broken"), strict=True):
        np.testing.assert_array_equal(line.get_ydata(), books[column])


def test_histograms_count_every_grain(run):
    """Bars add up to the grains, or clusters, that there are; each lies where its numbers are."""
    frame = sand.open(run).frames[0]
    for name, total in (("speed", 8), ("radius", 8), ("coordination", 8), ("material", 8), ("cluster", 4)):
        axes = grains_figure(frame, name).axes[0]
        assert sum(bar.get_height() for bar in axes.patches) == total
    axes = grains_figure(frame, "coordination").axes[0]
    assert [(bar.get_x() + bar.get_width() / 2, bar.get_height()) for bar in axes.patches] == [(1.0, 8)]
    assert "speed (mm/s)" in grains_figure(frame, "speed").axes[0].get_xlabel()
    with pytest.raises(BadInput, match="field_alignment is not known"):
        grains_figure(frame, "field_alignment")


def test_a_picture_from_a_script(run):
    """`sand.open(DIR).picture()` is the still of a frame, with the field of the case."""
    opened = sand.open(run)
    np.testing.assert_allclose(opened.flux_density(0.0), [0.0, 0.0, 1e-3])
    picture = opened.picture(0, colour="field_alignment", size=(300, 200))
    assert "B" in [text.get_text() for axes in picture.axes for text in axes.texts]
    assert picture._repr_png_()[:4] == b"\x89PNG"
    assert "t = 0 s" in [text.get_text() for text in picture.texts]
