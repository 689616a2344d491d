"""Which grains are at rest: in frames, the ledger, pictures, and the data of the viewer page."""

import numpy as np
import pytest

import sand
from sand.analysis.ledger_columns import LedgerColumns
from sand.analysis.quantities import measured
from sand.basics.box import Box
from sand.cli.main import main
from sand.components.walls import Walls
from sand.engine.changed_state import subset
from sand.io.gsd_index import read_index
from sand.io.trajectory import Frames, TrajectoryWriter
from sand.plotting.palettes import REST_COLOURS
from sand.plotting.plots import grains_figure, history_figure
from sand.plotting.render.still import still_picture
from sand.plotting.style import rgb
from sand.simulation.ledger import Ledger
from sand.viewer.dataset import run_dataset
from sand.viewer.series import series_from_ledger

from ..pages import decode
from ..synthetic_frames import R, frame_of
from ..synthetic_trajectories import contacts_of, grains_of

RESTS = ([1, 1, 0, 0, 1], [0, 0, 0, 0, 1], [1, 1, 1, 1, 1])


def trajectory(path, rests, grains=None):
    """Frames of five grains, 1 ps apart, with `at_rest` where it is not None."""
    writer = TrajectoryWriter(path / "trajectory.gsd")
    for k, rest in enumerate(rests):
        some, given = (grains_of(5) if grains is None else grains[k]), None if rest is None else np.array(rest) == 1
        writer.write(10 * k, 1e-12 * k, some, Box.open(), contacts_of([(0, 1)]), at_rest=given)
    writer.close()
    return path / "trajectory.gsd"


def test_frames_keep_what_is_at_rest(tmp_path):
    """As written, also through `frames.at_rest`, and the checksum of each frame covers it."""
    frames = Frames(trajectory(tmp_path, RESTS))
    assert [frame.at_rest.tolist() for frame in frames] == [[v == 1 for v in rest] for rest in RESTS]
    assert (np.asarray(frames.at_rest) == (np.array(RESTS) == 1)).all()
    stored = frames.stored(0)
    assert stored.log["particles/at_rest"].dtype == np.uint8
    stored.log["particles/at_rest"] = 1 - stored.log["particles/at_rest"]
    with pytest.raises(ValueError, match="checksum"):
        sand.io.frame.Frame(stored)


@pytest.mark.parametrize("rests", [(None, RESTS[0], None), (RESTS[0], None, RESTS[1])])
def test_frames_that_do_not_say_it(tmp_path, rests):
    """A frame without the array has None, whatever other frames of its file have; `frames.at_rest` says so."""
    frames = Frames(trajectory(tmp_path, rests))
    for k, rest in enumerate(rests):
        found = frames[k].at_rest
        assert found is None if rest is None else found.tolist() == [v == 1 for v in rest]
    with pytest.raises(sand.BadInput, match=f"at_rest: frame {rests.index(None)} of .* runs with rigid clusters do"):
        np.asarray(frames.at_rest)


def test_files_of_other_runs_have_no_chunk_of_it(tmp_path):
    """Without rigid clusters no name in the file ends in at_rest, and a frame has as many chunks as all its others."""
    path = trajectory(tmp_path, (None, None))
    assert b"at_rest" not in path.read_bytes()
    _, entries = read_index(path)
    (tmp_path / "rigid").mkdir()
    _, more = read_index(trajectory(tmp_path / "rigid", RESTS[:2]))
    assert len(more) == len(entries) + 2


def test_the_page_gets_it(tmp_path):
    """Manifest and packets of frames have it where the frames do; all grains that appear later are listed as well."""
    (tmp_path / "without").mkdir()
    without = run_dataset(trajectory(tmp_path / "without", (None,)))
    assert without.manifest()["at_rest"] is False and "at_rest" not in decode(without.frame(0))[1]
    first = grains_of(5)
    less = subset(first, np.array([0, 2, 3, 4]))
    dataset = run_dataset(trajectory(tmp_path, (RESTS[0], RESTS[0][1:]), (first, less)))
    manifest = dataset.manifest()
    assert manifest["at_rest"] is True and manifest["colours"]["rest"] == list(REST_COLOURS)
    _, arrays = decode(dataset.frame(0))
    assert arrays["at_rest"].dtype == np.uint8 and arrays["at_rest"].tolist() == RESTS[0]
    _, arrays = decode(dataset.frame(1))  # grain 1 is absent
    assert np.isnan(arrays["position"][1]).all() and arrays["at_rest"][[0, 2, 3, 4]].tolist() == RESTS[0][1:]


def test_pictures_show_it():
    """Swatches and bars of the two names with their numbers; frames without it are refused."""
    frame = frame_of(np.arange(5)[:, None] * [3 * R, 0, 0], at_rest=np.array(RESTS[0]) == 1)
    assert measured(frame, "at_rest").tolist() == RESTS[0]
    bars = grains_figure(frame, "at_rest").axes[0]
    assert [bar.get_height() for bar in bars.patches] == [2, 3]
    assert [text.get_text() for text in bars.get_xticklabels()] == ["awake", "at rest"]
    picture = still_picture(frame, colour="at_rest", view="front", size=(500, 300))
    assert {"awake", "at rest"} <= {text.get_text() for text in picture.texts}
    drawn = picture.scene.colour
    assert (drawn == np.array([rgb(REST_COLOURS[v]) for v in RESTS[0]])).all()
    for missing in (frame_of(frame.position), frame_of(frame.position, at_rest=None)):
        with pytest.raises(sand.BadInput, match="at_rest is not known: only runs with rigid clusters have it"):
            still_picture(missing, colour="at_rest")


def rows(awake):
    """Rows of a ledger with the columns that the panel of clusters draws."""
    sizes = {"mean_cluster_size": 2.0, "largest_cluster": 3, "clusters": 4}
    zeros = dict.fromkeys(Ledger(awake=True).columns, 0.0)
    return [zeros | sizes | {"step": k, "time": k * 1e-9, "awake": value} for k, value in enumerate(awake)]


def test_the_panel_of_clusters_shows_awake_grains():
    """An area up to the number of awake grains at each row, within the axis; none without the column."""
    told = [0, 0, 7, 0, 2]
    figure = history_figure(LedgerColumns.from_rows(rows(told)), "size", 10, 100.0)
    axes = figure.axes[0]
    (area,) = axes.collections
    path = area.get_paths()[0].vertices
    for k, value in enumerate(told):
        at = np.abs(path[:, 0] - k) < 0.51
        assert path[at, 1].max() >= value
    assert path[:, 1].max() == 7.0 < axes.get_ylim()[1]
    assert "awake grains (contact steps)" in [text.get_text() for text in axes.get_legend().get_texts()]
    without = [{name: value for name, value in row.items() if name != "awake"} for row in rows(told)]
    figure = history_figure(LedgerColumns.from_rows(without), "size", 10, 100.0)
    assert not figure.axes[0].collections and len(figure.axes[0].get_legend().get_texts()) == 3


def test_the_page_plots_awake_grains():
    """The page has a plot of the column, and none without it."""
    told = LedgerColumns.from_rows(rows([0, 3, 1]))
    plots = {plot["id"]: plot for plot in series_from_ledger(told)["plots"]}
    assert plots["awake"]["lines"][0]["values"] == [0.0, 3.0, 1.0]
    told = LedgerColumns([name for name in told.columns if name != "awake"], told.rows)
    assert "awake" not in {plot["id"] for plot in series_from_ledger(told)["plots"]}


def test_the_column_belongs_to_runs_with_rigid_clusters():
    """The last of the numbers, before those of walls; a ledger from a checkpoint without it goes on without it."""
    walls = Walls([sand.Wall([0, 0, 0], [0, 0, 1], "silica", name="floor")])
    columns = Ledger(extra=[walls], awake=True).columns
    assert columns[columns.index("awake") :] == ("awake", *walls.columns())
    plain, rigid = Ledger(), Ledger(awake=True)
    assert rigid.columns == (*plain.columns, "awake")
    table = np.arange(2.0 * len(plain.columns)).reshape(2, -1)
    rigid.from_array(table, plain.columns)
    assert rigid.columns == plain.columns and rigid.add(rigid.rows[-1] | {"time": 1e9, "awake": 3})
    assert rigid.to_array().shape == (3, len(plain.columns))
    with pytest.raises(sand.BadInput, match="columns"):
        Ledger(awake=True).from_array(table[:, 1:], plain.columns[1:])
    with pytest.raises(sand.BadInput, match="'awake' is a column of the ledger; give this force another name"):
        Ledger(["awake"])


@pytest.mark.parametrize(("stepping", "known"), [("", False), ('stepping = { clusters = "rigid" }', True)])
def test_conditions_of_case_files_may_name_it(tmp_path, capsys, stepping, known):
    """`stop = "awake == 0"` is accepted with rigid clusters, and an unknown quantity without."""
    case = tmp_path / "case.toml"
    text = f"""
        run = {{ until = "1 ns", stop = "awake == 0" }}
        {stepping}
        grains = {{ number = 2, radius = "10 nm", material = "iron" }}
        box = {{ periodic = "1 um" }}
        forces = {{ contact = {{ damping = "critical" }} }}
        """
    case.write_text(text, "utf-8")
    assert main(["info", str(case)]) == (0 if known else 2)
    assert ("unknown quantity 'awake'" in capsys.readouterr().err) != known
