"""The figure of a run: drawn values are those of the run, also for unusual runs."""

import io
from types import SimpleNamespace

import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

import sand
from sand.analysis.clusters import unwrapped
from sand.analysis.ledger_columns import LedgerColumns
from sand.basics.box import Box
from sand.basics.constants import BOLTZMANN
from sand.plotting.figure_format import figure_format
from sand.plotting.panels import draw_pressure, energy_unit, time_unit
from sand.plotting.render.directions import uniform_fields
from sand.plotting.render.scene import camera_rotation, make_scene, side_by_side, view_window
from sand.plotting.render.spheres import SUPERSAMPLING, Spheres, render_spheres
from sand.plotting.run_figure import figure_bytes, run_figure, save, show
from sand.plotting.style import format_si, round_length, si_prefix
from sand.simulation.ledger import Ledger


def ledger_of(rows, outside=()):
    """A ledger with these columns; others are zero, except one cluster of one grain."""
    ledger = Ledger(outside)
    for step, row in enumerate(rows):
        blank = dict.fromkeys(ledger.columns, 0.0)
        numbers = {"clusters": 1, "mean_cluster_size": 1.0, "largest_cluster": 1}
        ledger.add(blank | numbers | {"step": step} | row)
    return ledger


def run_of(position, radius=1e-8, pairs=(), box=None, rows=({},), temperature=0.0, outside=(), forces=(), **more):
    """The attributes of a simulation that the figure needs."""
    grains = sand.Grains(position, radius, sand.SILICA, **more)
    ledger = ledger_of(rows, outside)
    return SimpleNamespace(
        grains=grains,
        box=box or Box.open(),
        contacts={"pair": np.array(pairs, dtype=np.uint32).reshape(-1, 2)},
        ledger=ledger,
        temperature=temperature,
        forces=list(forces),
        notes=list,
        title="",
        time=ledger.rows[-1]["time"] if rows else 0.0,
    )


@pytest.fixture(scope="module")
def run_with_clusters():
    """Four grains in a periodic box, three of them in a cluster across a face, with a history."""
    rows = [
        {
            "time": k * 1e-8,
            "translation": 3e-20 * (1 + k),
            "rotation": 1e-20,
            "normal": -4e-18 * k,
            "sliding": 1e-20 * k,
            "magnetic": -1e-19 * k,
            "field": -2e-20,
            "lost_forming": 3e-18 * k,
            "lost_sliding": 1e-22 * k,
            "lost_settling": 1e-32 * k,
            "total": 1e-19 + 1e-22 * k,
            "clusters": 4 - k // 5,
            "mean_cluster_size": 1.0 + 0.15 * k,
            "largest_cluster": 1 + k // 5,
        }
        for k in range(11)
    ]
    position = np.array([[0.95, 0.0, 0.0], [-0.86, 0.0, 0.0], [-0.67, 0.0, 0.0], [0.0, 0.5, 0.5]]) * 1e-7
    return run_of(
        position,
        radius=[1e-8, 1e-8, 1e-8, 5e-9],
        pairs=[(0, 1), (1, 2)],
        box=Box.periodic("200 nm"),
        rows=rows,
        temperature=100.0,
        outside=("field",),
        moment=np.eye(4, 3) * 1e-18,
    )


@pytest.fixture(scope="module")
def figure(run_with_clusters):
    return run_figure(run_with_clusters)


def lines(axes):
    """Label → (x, y) of the labelled lines."""
    return {line.get_label(): line.get_data() for line in axes.get_lines() if line.get_label()[0] != "_"}


def texts(figure):
    """All text in a figure outside its ticks."""
    inside = [text.get_text() for axes in figure.axes for text in axes.texts]
    return " ".join([text.get_text() for text in figure.texts] + inside)


# --- history -----------------------------------------------------------------------------------------


@pytest.mark.slow
def test_clusters_drawn_are_the_ledgers(run_with_clusters, figure):
    """S, the largest cluster and the number of clusters are the ledger's columns over its times."""
    drawn = lines(figure.axes[0])
    columns = {"mean size S = Σs²/Σs": "mean_cluster_size", "largest size": "largest_cluster", "clusters": "clusters"}
    for label, column in columns.items():
        np.testing.assert_allclose(drawn[label][0], run_with_clusters.ledger["time"] / 1e-9)
        np.testing.assert_array_equal(drawn[label][1], run_with_clusters.ledger[column])


@pytest.mark.slow
def test_energies_drawn_are_the_ledgers(run_with_clusters, figure):
    """Kinetic, contact, magnetic and outside energies are sums of columns over N k_B T of the start."""
    unit, ledger = 4 * BOLTZMANN * 100.0, run_with_clusters.ledger
    drawn = lines(figure.axes[1])
    expected = {
        "kinetic": ledger["translation"] + ledger["rotation"],
        "contacts (elastic, adhesion)": ledger["normal"] + ledger["sliding"],
        "magnetic": ledger["magnetic"],
        "field": ledger["field"],
    }
    assert set(drawn) == set(expected)
    for label, energy in expected.items():
        np.testing.assert_allclose(drawn[label][1] * unit, energy)


def test_losses_drawn_are_the_ledgers(run_with_clusters, figure):
    """Channels that lost something are drawn where they did; the others are named."""
    drawn = lines(figure.axes[2])
    columns = {"contact formation": "forming", "sliding": "sliding"}
    assert set(drawn) == set(columns)
    for label, channel in columns.items():
        lost = drawn[label][1] * 4 * BOLTZMANN * 100.0
        np.testing.assert_allclose(np.nan_to_num(lost), run_with_clusters.ledger[f"lost_{channel}"])
    assert "none: contact breaking, rolling, twisting" in texts(figure)


def test_balance_is_the_change_of_the_total(run_with_clusters, figure):
    """The lowest panel shows the total minus its start, within its limits, and the ledger's drift."""
    axes = figure.axes[3]
    change = axes.get_lines()[-1].get_ydata() * 4 * BOLTZMANN * 100.0
    np.testing.assert_allclose(change, run_with_clusters.ledger["total"] - 1e-19, atol=1e-30)
    low, high = axes.get_ylim()
    assert low < min(axes.get_lines()[-1].get_ydata()) and max(axes.get_lines()[-1].get_ydata()) < high
    assert f"{run_with_clusters.ledger.drift:.1e}".split("e")[0] in texts(figure)


def test_every_curve_is_within_the_axis_limits(figure):
    """No limit of an axis cuts off a curve of energies or clusters."""
    for axes in (*figure.axes[:2], figure.axes[4]):
        low, high = axes.get_ylim()
        for _, y in lines(axes).values():
            assert low <= np.min(y) and np.max(y) <= high


def test_units_are_natural():
    """Time has the prefix of its largest value; energy is in N k_B T, without T in joules with a prefix."""
    ledger = ledger_of([{"time": 0.0}, {"time": 3e-7, "translation": 2.5e-17}])
    assert time_unit(ledger).name == "ns"
    assert time_unit(ledger).size == 1e-9
    assert energy_unit(ledger, 0.0, 5).name == "aJ"
    assert energy_unit(ledger, 0.0, 5).size == 1e-18
    assert energy_unit(ledger, 50.0, 5).size == pytest.approx(5 * BOLTZMANN * 50.0, rel=1e-6, abs=0.0)


def collision_rows(clusters=2):
    """A ledger of bodies that fly at 1 pJ and have lost half of that in the end."""
    return [
        {"time": 0.0, "translation": 0.9e-12, "rotation": 0.1e-12, "clusters": clusters, "contacts": 2},
        {"time": 1e-6, "translation": 0.5e-12, "lost_rolling": 0.5e-12, "clusters": 1, "contacts": 3, "made": 1},
    ]


@pytest.mark.parametrize("temperature", [0.0, 1.8e6])
def test_energies_of_two_bodies_are_in_units_of_their_motion(temperature):
    """Up to two bodies: E₀ = E_trans + E_rot at the start, whose value is stated; a temperature is not."""
    unit = energy_unit(ledger_of(collision_rows()), temperature, 128)
    assert unit.size == pytest.approx(1e-12, rel=1e-12, abs=0.0)
    assert unit.name == "$E_0$" and "= 1 pJ" in unit.value
    several = energy_unit(ledger_of(collision_rows(3)), temperature, 128)
    assert several.name == (r"$N k_\mathrm{B}T_0$" if temperature else "pJ")


@pytest.mark.draws
def test_figure_of_a_collision():
    """The title of the collision, contacts in place of clusters, curves from 1 to the share that is left, no T₀."""
    run = run_of(np.eye(4, 3) * 1e-7, rows=collision_rows(), temperature=1.8e6)
    run.title = "Collision of 3 + 1 grains of silica at 1 m/s, head-on: they stick"
    figure = run_figure(run)
    shown = texts(figure)
    assert run.title in shown and "1 body" in shown and "$E_0$ = 1 pJ" in shown
    assert "T_0" not in shown and "open space" not in shown
    assert all("T_0" not in axes.get_ylabel() for axes in figure.axes)
    assert set(lines(figure.axes[0])) == {"contacts", "formed so far", "broken so far"}
    np.testing.assert_allclose(lines(figure.axes[1])["kinetic"][1], [1.0, 0.5], rtol=1e-12)


# --- grains ------------------------------------------------------------------------------------------


def test_spheres_stand_where_the_grains_are(run_with_clusters):
    """Positions are unwrapped, each cluster shifted by whole boxes; radii are unscaled."""
    pairs = run_with_clusters.contacts["pair"]
    scene = make_scene(run_with_clusters.grains, pairs, run_with_clusters.box)
    shifted = (scene.position - unwrapped(run_with_clusters.grains.position, pairs, run_with_clusters.box)) / 2e-7
    np.testing.assert_allclose(shifted, np.round(shifted), atol=1e-9)
    np.testing.assert_allclose(np.diff(shifted[:3], axis=0), 0.0, atol=1e-9)
    np.testing.assert_array_equal(scene.radius, run_with_clusters.grains.radius)
    np.testing.assert_allclose(np.diff(scene.position[:3, 0]), 1.9e-8)


def test_projection_is_a_rotation():
    """Rows right, up and eye are orthonormal and right-handed, and z shows upwards."""
    rotation = camera_rotation()
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(rotation) == pytest.approx(1.0, rel=1e-6, abs=0.0)
    assert rotation[0, 2] == 0.0 and rotation[1, 2] > 0.9


def test_picture_shows_each_grain_at_its_place(run_with_clusters):
    """The picture has a grain's colour at its projected centre, with its size, and nothing beside it."""
    scene = make_scene(run_with_clusters.grains, run_with_clusters.contacts["pair"], run_with_clusters.box)
    balls = scene.projected(camera_rotation())
    np.testing.assert_allclose(balls.centre[:, 0], scene.position @ camera_rotation()[0])
    bare = Spheres(balls.centre, balls.radius, balls.colour, np.zeros_like(balls.arrow))
    window = view_window(scene, 1.0)
    picture = render_spheres(bare, window, 400, 400)
    scale = 400 / (window[1] - window[0])
    for i in range(4):
        column, row = ((balls.centre[i, :2] - np.array([window[0], window[2]])) * scale).astype(int)
        assert picture[row, column, 3] == 1.0
        seen, true = picture[row, column, :3], balls.colour[i]
        assert np.argmax(seen) == np.argmax(true) or np.ptp(true) < 0.1
    alone = Spheres(bare.centre[3:], bare.radius[3:], bare.colour[3:], bare.arrow[3:])
    area = render_spheres(alone, window, 400, 400)[..., 3].sum()
    assert area == pytest.approx(np.pi * (5e-9 * scale) ** 2, rel=0.02, abs=0.0)


def test_nearer_grains_hide_farther_ones():
    """Of two spheres behind each other the nearer one (larger z) is visible."""
    red, blue = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
    for order in ([0, 1], [1, 0]):
        centre = np.array([[0.0, 0.0, 3.0], [0.0, 0.0, -3.0]])[order]
        colour = np.array([red, blue])[order]
        picture = render_spheres(Spheres(centre, np.ones(2), colour, np.zeros((2, 3))), (-2.0, 2.0, -2.0, 2.0), 40, 40)
        assert picture[20, 20, 0] > picture[20, 20, 2]


def test_clusters_have_different_colours():
    """Grains of one cluster share a colour, other clusters have another, single grains are grey."""
    chain = [[2.0 * i, 0.0, 0.0] for i in range(6)]
    scene = make_scene(sand.Grains(np.array(chain), 1.0, "ice"), np.array([(0, 1), (1, 2), (3, 4)]), Box.open())
    first, second, single = scene.colour[0], scene.colour[3], scene.colour[5]
    assert np.all(scene.colour[:3] == first) and np.all(scene.colour[3:5] == second)
    assert not np.allclose(first, second)
    assert np.ptp(single) < 0.05 < np.ptp(first)


def test_arrows_point_along_moments():
    """An arrow is wider at its head than at its tail; along the line of sight it is a dot."""
    bare = Spheres(np.zeros((1, 3)), np.ones(1), np.ones((1, 3)), np.zeros((1, 3)))

    def covered(half):
        with_arrow = Spheres(bare.centre, bare.radius, bare.colour, np.array([half]))
        window = (-1.2, 1.2, -1.2, 1.2)
        return (
            np.abs(render_spheres(with_arrow, window, 120, 120) - render_spheres(bare, window, 120, 120))[..., :3].max(
                axis=2
            )
            > 0.3
        )

    arrow = covered([0.9, 0.0, 0.0])
    assert arrow[:, 75].sum() > 2 * arrow[:, 45].sum() > 0  # x = ±0.3
    assert arrow[60, 102] and not arrow[60, 107] and arrow[60, 17] and not arrow[60, 13]
    dot = covered([0.0, 0.0, 0.9])
    x, y = np.meshgrid(np.linspace(-1.19, 1.19, 120), np.linspace(-1.19, 1.19, 120))
    assert dot[60, 60] and not dot[np.hypot(x, y) > 0.4].any()


def test_arrows_are_in_proportion(run_with_clusters):
    """The largest moment has the longest arrow, weak ones stay visible, grains without one have none."""
    moment = np.array([[0.0, 0.0, 2.0], [0.0, 1.0, 0.0], [1e-3, 0.0, 0.0], [0.0, 0.0, 0.0]]) * 1e-18
    grains = sand.Grains(run_with_clusters.grains.position, 1e-9, sand.SILICA, moment=moment)
    size = np.linalg.norm(make_scene(grains, np.empty((0, 2)), run_with_clusters.box).arrow, axis=1)
    assert size[0] == pytest.approx(2 * size[1], rel=1e-6, abs=0.0)
    assert size[0] > size[1] > size[2] > 0.0 == size[3]


def test_largest_clusters_are_moved_as_rigid_bodies(run_with_clusters):
    """Separately drawn clusters keep all distances, do not overlap, and are sorted by size."""
    position = [[0, 0, 0], [2, 0, 0], [2, 2, 0], [9, 9, 9], [9, 9, 11]]
    pairs = np.array([(3, 4), (0, 1), (1, 2)])
    scene = make_scene(sand.Grains(np.array(position, float), 1.0, "ice"), pairs, Box.open())
    balls, _, sizes, rotations = side_by_side(scene, 3)
    assert sizes == [3, 2]
    turned = balls.centre[3:] - scene.position[3:] @ rotations[1].T
    np.testing.assert_allclose(turned[0], turned[1], rtol=0.0, atol=1e-12)

    def distance(p):
        return np.linalg.norm(p[:, None] - p[None], axis=-1)

    np.testing.assert_allclose(distance(balls.centre[:3]), distance(scene.position[:3]))
    np.testing.assert_allclose(distance(balls.centre[3:]), distance(scene.position[3:]))
    assert balls.centre[3:, 0].min() - balls.centre[:3, 0].max() > 2.0


def test_scale_bar_has_the_stated_length(figure):
    """The bar's length in data coordinates (metres) equals its label."""
    axes = figure.axes[4]
    (bar,) = [line for line in axes.get_lines() if line.get_gid() == "scale"]
    length = float(np.ptp(bar.get_xdata()))
    assert format_si(length, "m") in [text.get_text() for text in axes.texts]


@pytest.mark.slow
def test_box_has_twelve_edges(figure):
    """A periodic box is drawn; open space is not."""
    edges = [line for line in figure.axes[4].get_lines() if line.get_gid() == "box"]
    assert len(edges) == 12
    alone = run_figure(run_of([[0.0, 0.0, 0.0]]))
    assert not [line for line in alone.axes[-1].get_lines() if line.get_gid() == "box"]


@pytest.mark.parametrize(
    ("force", "time", "text"),
    [
        (sand.Field("1 mT"), 0.0, "B = 1 mT along z"),
        (sand.Field([0, -3e-3, 4e-3]), 0.0, "B = 5 mT along (0, −0.6, 0.8)"),
        (sand.Field([-2, 0, 0]), 0.0, "B = 2 T along −x"),
        (sand.Field(0, shape="oscillating", amplitude=1e-3, frequency=1e6), 0.0, "B = 1 mT along z at this time"),
        (sand.Field(0, shape="oscillating", amplitude=1e-3, frequency=1e6), 0.25e-6, "B = 0 at this time"),
        (sand.Field(0, shape="ramp", final="2 mT", end="1 us"), 0.5e-6, "B = 1 mT along z at this time"),
        (sand.Field(sand.Ramp([[0, 0, 0], [0, 0, 1]], ["0 ns", "2 ns"])), 1e-9, "B = 500 mT along z at this time"),
        (sand.ElectricField("1 kV/m"), 0.0, "E = 1 kV/m along z"),
        (sand.Gravity("9.81 m/s^2"), 0.0, "g = 9.81 m/s² along −z"),
        (sand.Field(0), 0.0, ""),
        (sand.Contact(), 0.0, ""),
    ],
)
def test_uniform_fields_in_words(force, time, text):
    """The value at the time of the figure and its direction; a field that is always 0 is left out."""
    assert " ".join(field.text() for field in uniform_fields([force], time)) == text


@pytest.mark.parametrize("width", [None, "3.4in"])
def test_the_field_of_a_run_is_shown(run_with_clusters, width):
    """The header has the field; its arrow is along the projected field, and below each cluster turned as the cluster.

    No label of an axis reaches the letter of its panel, and no note the numbers of the axis.
    """
    run = SimpleNamespace(**vars(run_with_clusters))
    run.forces = [sand.Field([1e-3, 2e-3, 5e-3])]
    run.grains = sand.Grains(run.grains.position, 0.2 * run.grains.radius, "silica", moment=run.grains.moment)
    with figure_format(width):
        figure = run_figure(run)
    assert "B = 5.48 mT along (0.18, 0.37, 0.91)" in " ".join(text.get_text() for text in figure.texts).replace(
        "\n", " "
    )
    scene = make_scene(run.grains, run.contacts["pair"], run.box)
    rotations = [camera_rotation(), *side_by_side(scene, 3)[3]]
    drawn = [(axes, text) for axes in figure.axes for text in axes.texts if text.get_gid() == "direction of B"]
    assert len(drawn) == len(rotations) == 2
    for (axes, arrow), rotation in zip(drawn, rotations, strict=True):
        seen = np.array(arrow.xy) - arrow.xyann
        expected = (rotation @ [1, 2, 5])[:2]
        assert seen @ expected == pytest.approx(np.hypot(*seen) * np.hypot(*expected), rel=1e-6, abs=0.0)
        assert {"x", "y", "z"} & {text.get_text() for text in axes.texts} and "B" in texts(figure)
    for axes in figure.axes[:4]:
        letter = next(text for text in axes.texts if text.get_text() in "abcdefgh")
        assert not axes.yaxis.label.get_window_extent().overlaps(letter.get_window_extent())
        notes = [text for text in axes.texts if text.get_text().startswith("none: ")]
        assert all(note.get_window_extent().x0 > axes.bbox.x0 for note in notes)


# --- unusual runs ------------------------------------------------------------------------------------


def unusual_runs():
    """Extreme but valid runs."""
    two = [[0.0, 0.0, 0.0], [3e-8, 0.0, 0.0]]
    nan = {"time": 1e-9, "translation": np.nan, "normal": np.inf, "total": np.nan, "lost_forming": np.nan}
    far = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]
    slab = Box.periodic("60 nm", "60 nm", None)
    return {
        "one grain at rest, one row": run_of(two[:1]),
        "two grains, unequal, touching": run_of(two, [1e-8, 2e-8], [(0, 1)], rows=[{"time": 0.0}, {"time": 1.0}]),
        "grains a metre apart": run_of(far),
        "a slab": run_of(two, box=slab, temperature=10.0),
        "no history": run_of(two, rows=()),
        "numbers that are none": run_of(two, rows=[{"time": 0.0, "translation": 1e-20}, nan], temperature=1.0),
        "only numbers that are none": run_of(two, rows=[nan, nan]),
        "a decade in one channel": run_of(two, rows=[{"time": 1e-9 * k, "lost_rolling": 10.0**k} for k in (0, 1)]),
        "forty decades": run_of(two, rows=[{"time": 1e-9, "normal": -1e-20, "magnetic": 1e20, "lost_forming": 1e-300}]),
    }


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        name if name in ("no history", "numbers that are none") else pytest.param(name, marks=pytest.mark.validate)
        for name in unusual_runs()
    ],
)
def test_unusual_runs_have_a_figure(name):
    """Each gives a PNG of 1600 × 1000 pixels without a warning."""
    picture = Image.open(io.BytesIO(figure_bytes(run_figure(unusual_runs()[name]))))
    assert picture.size == (1600, 1000)


@pytest.mark.slow
def test_grains_with_nan_positions_are_omitted():
    """After numerical failure finite grains are drawn and the others mentioned."""
    run = run_of([[0.0, 0.0, 0.0], [3e-8, 0.0, 0.0]])
    run.grains.arrays.position[0, 1] = np.nan
    figure = run_figure(run)
    assert "left out: 1" in texts(figure)
    run.grains.arrays.position[0, 0] = np.inf
    assert len(run_figure(run).axes) == 4  # the panels over time


def test_pressure_of_a_run_with_stress():
    """Its panel has the pressure of the instant and the means along deformed axes, in one unit; others have none."""
    rows = [{"step": k, "time": 1e-8 * k, "pressure": 2e3 * k, "mean_pressure_x": -500.0 * k} for k in range(4)]
    axes = Figure().subplots()
    ledger = LedgerColumns.from_rows(rows)
    draw_pressure(axes, ledger, time_unit(ledger))
    lines = {one.get_label(): one.get_ydata().tolist() for one in axes.get_lines() if one.get_label()[0] != "_"}
    assert axes.get_ylabel() == "$P$ (kPa)"
    assert lines == {"instant": [0.0, 2.0, 4.0, 6.0], "mean, x": [0.0, -0.5, -1.0, -1.5]}


@pytest.mark.slow
def test_thousand_grains_keep_their_shades(tmp_path):
    """A thousand grains in one cluster are drawn without colour quantisation."""
    rng = np.random.default_rng(7)
    position = rng.normal(size=(1000, 3)) * 6e-8
    run = run_of(position, 1e-8, [(i, i + 1) for i in range(0, 998, 3)], moment=rng.normal(size=(1000, 3)))
    save(run_figure(run), tmp_path / "figure.png")
    assert len(np.unique(np.asarray(Image.open(tmp_path / "figure.png").convert("RGB")))) > 200
    assert [path.name for path in tmp_path.iterdir()] == ["figure.png"]


# --- the rest ----------------------------------------------------------------------------------------


@pytest.mark.draws
@pytest.mark.compiled("contacts")
def test_figure_of_a_simulation():
    """`figure` returns a figure, which notebooks show as PNG, also before the first step."""
    grains = sand.Grains([[0.0, 0.0, 0.0], [2.5e-8, 0.0, 0.0]], "10 nm", sand.SILICA)
    figure = sand.Simulation(grains, forces=[sand.Contact()]).figure()
    assert isinstance(figure, Figure)
    assert figure._repr_png_()[:4] == b"\x89PNG"


@pytest.mark.slow
def test_nothing_global_changes(run_with_clusters):
    """Neither matplotlib's settings nor its list of open figures change."""
    from matplotlib import pyplot

    before, open_figures = dict(matplotlib.rcParams), pyplot.get_fignums()
    with matplotlib.rc_context({"font.size": 31.0, "axes.grid": True}):
        figure = run_figure(run_with_clusters)
        figure_bytes(figure)
        assert matplotlib.rcParams["font.size"] == 31.0
    assert figure.texts[0].get_size() < 31.0
    assert dict(matplotlib.rcParams) == before
    assert pyplot.get_fignums() == open_figures
    assert show(figure) is figure


@pytest.mark.slow
def test_figures_are_reproducible(run_with_clusters):
    """Two figures of one run are equal byte for byte."""
    assert figure_bytes(run_figure(run_with_clusters)) == figure_bytes(run_figure(run_with_clusters))


@pytest.mark.parametrize(
    ("size", "text"), [(1.2e-6, "1.2 µm"), (1e-9, "1 nm"), (0.0, "0 m"), (999.0e-9, "999 nm"), (1e-3, "1 mm")]
)
def test_numbers_with_si_prefix(size, text):
    """The prefix leaves one to three digits before the decimal point."""
    assert format_si(size, "m") == text


def test_prefixes_and_round_lengths():
    """Prefixes end with the largest SI prefix; round lengths are 1, 2 or 5 × 10^n within the limit."""
    assert si_prefix(np.nan, "s") == (1.0, "s")
    assert si_prefix(1e-30, "J") == (1e-24, "yJ")
    for at_most in (1e-9, 1.99e-9, 2e-9, 4.7e-8, 9.9e-7, 5.0):
        length = round_length(at_most)
        assert at_most / 2.5 < length <= at_most * (1.0 + 1e-6)
        assert f"{length:e}"[0] in "125"
    assert SUPERSAMPLING >= 2
