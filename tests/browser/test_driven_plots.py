"""Every plot, colour and kind of contact of a run folder as a simulation writes it, and axes of any numbers."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

import sand

from .driving import Driven, differ, image, served

SCREENS = {"laptop": (1280, 800), "large": (1920, 1080), "phone": (400, 840)}
INK = 60
"""Levels by which lines differ from the background."""


@pytest.fixture(scope="module")
def address(bundle, tmp_path_factory) -> Iterator[str]:
    """Of a gas of magnetic grains with rigid clusters, whose bodies settle: the least loss is 1e-12 of the largest."""
    folder = tmp_path_factory.mktemp("runs") / "gas"
    box = sand.Box.periodic("0.4 um")
    grains = sand.setup.gas(
        24, box, radius="10 nm", material=sand.IRON, moment="200 A m^2/kg", temperature="100 K", seed=1
    )
    contact = sand.Contact(damping="critical", damping_ratio=0.2, settling_time="5 ns")
    forces = [contact, sand.Dipoles(periodic="ewald")]
    run = sand.Simulation(grains, box=box, forces=forces, stepping=sand.RigidClusters(), out=folder)
    run.run(until="0.3 us")
    with served(folder, None) as server:
        yield server.url


@pytest.fixture
def view(page, address) -> Driven:
    return Driven(page, address, bare=True)


def plotted(view: Driven) -> np.ndarray:
    """Which pixels of the plotted area are not background or grid: (H, W) bool."""
    view.settle()
    view.tab.evaluate("() => { document.querySelector('.gv-cursor').style.visibility = 'hidden'; }")
    area = image(view.tab.locator(".gv-plot .u-over").screenshot())[..., :3].astype(int)
    return (np.abs(area - area[0, 0]).max(axis=-1) > INK)[2:-2, 2:-2]


@pytest.mark.parametrize("screen", SCREENS)
def test_every_plot_is_drawn(page, address, screen):
    """Each entry of "Plot" has curves over the width of its area and two ticks and more; no error in the page."""
    page.set_viewport_size(dict(zip(("width", "height"), SCREENS[screen], strict=True)))
    view = Driven(page, address, bare=True)
    options = view.run("app.state.setting('plot').options.map(([name]) => name)")
    assert {"clusters", "energies", "losses", "contacts", "balance", "temperatures", "awake"} <= set(options)
    for name in options:
        view.put(plot=name)
        ink = plotted(view)
        assert ink.any(axis=0).mean() > 0.5, name
        assert len(view.run("app.plot.axis.ticks")) >= 2, name
    view.open(f"{address}#plot=losses")
    assert plotted(view).any()


def test_every_colour_is_drawn(view):
    """Each entry of "Colour by" draws grains, and says in the legend what they are coloured by."""
    seen = set()
    for name in view.run("app.state.setting('colour').options.map(([name]) => name)"):
        view.control("colour").select_option(name)
        whole = view.picture()
        view.put(size=0.01)
        assert differ(whole, view.picture(), by=8) > 100, name
        view.put(size=1.0)
        seen.add(view.text(".gv-legend"))
    assert len(seen) == len(view.run("app.state.setting('colour').options"))


def test_every_kind_of_contact_is_drawn(view):
    """Each entry of "Contacts" makes another picture of small grains."""
    view.put(size=0.4, arrows=False)
    view.press("Z")
    pictures = []
    for name in view.run("app.state.setting('bonds').options.map(([name]) => name)"):
        view.control("bonds").select_option(name)
        pictures.append(view.picture())
    assert len(pictures) == 4
    told = [view.run("app.world.bonds.mesh.visible")]
    assert told == [True]
    drawn = [differ(pictures[0], other) for other in pictures[1:]]
    assert min(drawn) > 20


VALUES = {
    "zeros": [0.0, 0.0, 0.0],
    "one number": [3.0, 3.0, 3.0],
    "one tiny number": [1e-30, 1e-30, 1e-30],
    "one point": [None, 5e-21, None],
    "nothing": [None, None, None],
    "negative": [-3.0, -2.0, -1e-30],
    "tiny": [0.0, 2.262426e-27, 2.5e-18],
    "smallest": [0.0, 5e-324, 2e-320],
    "huge": [1e300, -1e300, 1e299],
    "signs": [-1e-12, 0.0, 3e-24],
    "close": [1.0, 1.0 + 2e-16, 1.0],
    "decades": [1e-30, 1.0, 1e30],
}
"""Of one line."""


@pytest.mark.parametrize("axis", ["linear", "log", "symlog"])
@pytest.mark.parametrize("values", VALUES)
def test_axes_of_any_numbers(view, axis, values):
    """At most twelve ticks with different labels, in order and on the axis; no error; no number beyond the axis.

    A logarithmic axis ends, and a symmetric one becomes linear, a million below the largest magnitude.
    """
    numbers = [v for v in VALUES[values] if v]
    least = 1e-6 * max(map(abs, numbers), default=0.0) or None
    line = {"label": "a", "hint": "", "light": "#000000", "dark": "#ffffff", "values": VALUES[values]}
    plot = {"id": "any", "title": "Any", "unit": "J", "axis": axis, "least": least, "lines": [line]}
    series = {"time": [0.0, 1e-9, 2e-9], "plots": [plot], "events": {"time": [], "made": [], "broken": []}}
    view.run("app.plot.show(told[0], told[0].plots[0], false)", series)
    view.settle()
    found = view.run("app.plot.axis")
    places, labels = [t["place"] for t in found["ticks"]], [t["label"] for t in found["ticks"]]
    assert found["high"] > found["low"]
    slack = 1e-9 * (found["high"] / 2 - found["low"] / 2)
    assert len(places) <= 12 and places == sorted(places)
    assert all(found["low"] - slack <= place <= found["high"] + slack for place in places)
    assert len(set(labels)) == len(labels)
    shares = [v for v in view.run("app.plot.chart.data[1]") if v is not None]
    assert all(v <= 1.0 for v in shares) and (axis == "log" or all(v >= 0.0 for v in shares))
    if numbers and (values != "smallest" or axis != "linear"):
        assert places, "no ticks"


def test_labels_are_whole(view):
    """Entries of the three choices are not cut off; nothing of the plot lies over its ticks or outside of the page."""
    measure = """(id) => { const select = document.getElementById(id), style = getComputedStyle(select);
      const pen = document.createElement("canvas").getContext("2d"); pen.font = style.font;
      const room = select.clientWidth - parseFloat(style.paddingLeft) - parseFloat(style.paddingRight) - 16;
      return [...select.options].map((one) => [one.text, pen.measureText(one.text).width - room]); }"""
    for name in ("colour", "bonds", "plot"):
        for text, beyond in view.tab.evaluate(measure, f"gv-{name}"):
            assert beyond <= 0.0, (name, text)
    for name in view.run("app.state.setting('plot').options.map(([name]) => name)"):
        view.put(plot=name)
        head, chart = (view.tab.locator(f".gv-plot {part}").bounding_box() for part in (".gv-plot-head", ".uplot"))
        over = view.tab.locator(".gv-plot .u-over").bounding_box()
        assert head["y"] + head["height"] <= chart["y"] + 1 < over["y"] - 5  # half a label is above the first tick
        assert chart["y"] + chart["height"] <= view.tab.viewport_size["height"]
        wide = "(e) => e.scrollWidth - e.clientWidth"
        assert view.tab.locator(".gv-plot-head").evaluate(wide) <= 0, name


def test_losses_are_explained(view):
    """The words on each loss, in the legend of the plot and beside its share, are those of the table of the ledger."""
    from sand.plotting.panels import CHANNEL_LABELS, LOSS_CHANNELS, loss_text

    texts = {CHANNEL_LABELS.get(name, name): loss_text(name) for name in LOSS_CHANNELS}
    view.put(plot="losses")
    rows = view.tab.locator(".gv-plot .u-series").all()
    assert len(rows) >= 3
    for row in rows:
        assert row.get_attribute("title").startswith(texts[row.inner_text().strip()])
    told = view.tab.locator(".gv-glance > div").first.locator("li[title]").all()
    assert len(told) >= 2
    for row in told:
        assert any(
            row.inner_text().startswith(label) and row.get_attribute("title") == text for label, text in texts.items()
        )


def test_the_sign_of_stretch_is_explained(view):
    """The row says what positive and negative are; a contact at rest of this run is at −1.21, as the words say."""
    view.press("k")
    row = view.tab.locator(".gv-inspector tr", has_text="stretch / limit")
    words = row.get_attribute("title")
    assert "1 where it breaks" in words and "negative if they overlap" in words and "−1.21" in words
    shares = view.run("[...app.picture.frame.share].filter((_, k) => k % 4 === 0)")
    assert np.median(shares) == pytest.approx(-2 * 6 ** (1 / 3) / 3, abs=0.1)


def test_clusters_say_what_is_not_counted(view):
    told = view.tab.locator(".gv-glance-title", has_text="rigid clusters")
    assert "single grains are not counted" in told.get_attribute("title")
