"""`sand plot`: files written, and refusals that leave nothing behind."""

import json

import pytest
from PIL import Image

from sand.cli.main import main
from sand.plotting.plots import HISTORY


@pytest.mark.compiled("fields")
def test_default_figures(run_in_field, tmp_path, capsys):
    """All figures over time and a still picture in DIR/plots; the written files are listed."""
    assert main(["plot", str(run_in_field), "--json"]) == 0
    message = json.loads(capsys.readouterr().out)["files"]
    assert message == [str(run_in_field / "plots" / f"{name}.png") for name in (*HISTORY, "still")]
    still = Image.open(run_in_field / "plots" / "still.png")
    assert still.size == (1600, 1000) and still.info["dpi"] == pytest.approx((160, 160), rel=0.0, abs=0.0128)
    assert main(["plot", str(run_in_field)]) == 2
    assert capsys.readouterr().err.count("exists; give another --out, or --overwrite") == 1
    assert main(["plot", str(run_in_field), "--overwrite", "--what", "size"]) == 0
    assert main(["info", str(run_in_field)]) == 0  # the folder is still recognised as a run


@pytest.mark.compiled("fields")
def test_chosen_figures_and_formats(run_in_field, tmp_path, capsys):
    """Histograms of quantities, a still of a frame with a given size; PDF and SVG."""
    out = str(tmp_path / "there")
    words = ["--what", "speed,still", "--size", "300x200", "--frame", "0", "--bonds", "load", "--colour", "size"]
    for form, start in (("pdf", b"%PDF"), ("svg", b"<?xml"), ("png", b"\x89PNG")):
        assert main(["plot", str(run_in_field), "--out", out, "--format", form, *words, "--dark", "--transparent"]) == 0
        for name in ("speed", "still"):
            assert (tmp_path / "there" / f"{name}.{form}").read_bytes().startswith(start)
    assert Image.open(tmp_path / "there" / "still.png").size == (300, 200)
    assert Image.open(tmp_path / "there" / "still.png").getpixel((298, 2))[3] == 0


@pytest.mark.compiled("fields")
@pytest.mark.parametrize(
    ("words", "pixels"),
    [
        ("--dpi 600 --size 1x0.5in", (600, 300)),
        ("--dpi 300 --size 5.08x2.54cm", (600, 300)),
        ("--dpi 300 --size 50.8x25.4mm", (600, 300)),
        ("--dpi 300 --size 400x300", (400, 300)),
    ],
)
def test_pixels_of_a_still(run_in_field, tmp_path, words, pixels):
    """Pixels are a printed size times the pixels per inch, which the file states, or those of --size.

    A PNG states whole pixels per metre: ± 0.5 of them are ± 0.0127 per inch.
    """
    assert main(["plot", str(run_in_field), "--what", "still", "--out", str(tmp_path / "there"), *words.split()]) == 0
    picture = Image.open(tmp_path / "there" / "still.png")
    dpi = int(words.split()[1])
    assert picture.size == pixels
    assert picture.info["dpi"] == pytest.approx((dpi, dpi), rel=0.0, abs=0.0128)


@pytest.mark.compiled("fields")
def test_pixels_of_figures(run_in_field, tmp_path, capsys):
    """--dpi 600: 5.6 × 3.5 inches are 3360 × 2100 pixels; a still beyond the largest size is refused; --quiet."""
    words = ["plot", str(run_in_field), "--out", str(tmp_path / "there"), "--quiet", "--dpi"]
    assert main([*words, "600", "--what", "size"]) == 0
    assert capsys.readouterr() == ("", "")
    assert Image.open(tmp_path / "there" / "size.png").size == (3360, 2100)
    assert main([*words, "1200", "--what", "still"]) == 2
    assert "size 12000x7500: width and height must be from 200 to 8000 pixels" in capsys.readouterr().err


@pytest.mark.compiled("fields")
def test_a_trajectory_alone(run_in_field, tmp_path, capsys):
    """A .gsd file has no ledger: a still picture by default, beside it."""
    alone = tmp_path / "alone.gsd"
    alone.write_bytes((run_in_field / "trajectory.gsd").read_bytes())
    assert main(["plot", str(alone), "--size", "300x200"]) == 0
    assert [p.name for p in (tmp_path / "alone-plots").iterdir()] == ["still.png"]
    assert main(["plot", str(alone), "--what", "size"]) == 2
    assert "has no ledger; give a run's folder" in capsys.readouterr().err


@pytest.mark.compiled("fields")
def test_missing_run_ledger_or_frame(run_in_field, tmp_path, capsys):
    """No run, no ledger, a ledger without rows, no frame: one line, and nothing is written."""
    assert main(["plot", str(tmp_path)]) == 2
    assert "is not the folder of a run" in capsys.readouterr().err
    (tmp_path / "trajectory.gsd").write_bytes((run_in_field / "trajectory.gsd").read_bytes())
    assert main(["plot", str(tmp_path), "--what", "size"]) == 2
    assert "there is no file" in capsys.readouterr().err
    (tmp_path / "ledger.csv").write_text((run_in_field / "ledger.csv").read_text().split("\n")[0] + "\n")
    assert main(["plot", str(tmp_path), "--what", "size"]) == 2
    assert "the ledger has no row yet" in capsys.readouterr().err
    (tmp_path / "ledger.csv").write_text("step,time\n0,0.0\n")
    assert main(["plot", str(tmp_path), "--what", "size"]) == 2
    assert "the ledger was written by another version of SAND: there is no column" in capsys.readouterr().err
    assert not (tmp_path / "plots").exists()
    import gsd.hoomd

    gsd.hoomd.open(str(tmp_path / "trajectory.gsd"), "w").close()
    assert main(["plot", str(tmp_path), "--what", "still"]) == 2
    assert "has no frame yet" in capsys.readouterr().err
