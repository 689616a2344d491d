"""What is told of a frame as a whole, and how much of the picture is left free."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np
import pytest

from sand.basics.state import LOST
from sand.viewer.external_field import FieldDescription

from .driving import Driven, served
from .small_runs import FRAMES, GRAINS, STEP, SmallRun, at_rest, grains, pairs, positions, row

SCREENS = {"wide": (1280, 800), "narrow": (800, 560), "phone": (390, 844), "phone on its side": (844, 390)}
RISING = FieldDescription("rising", lambda time: (0.0, 0.0, 1e-3 * (1.0 + time / STEP)))
TOLD = """() => [...document.querySelectorAll(".gv-glance > div")].map((part) => [
  part.querySelector(".gv-glance-title").textContent,
  [...part.querySelectorAll(".gv-shares span")].map((span) => parseFloat(span.style.width)),
  [...part.querySelectorAll("li")].map((li) => li.textContent)])"""
COVER = """([x, y]) => document.elementFromPoint(x, y)?.className"""


@pytest.fixture(scope="module")
def address(bundle, tmp_path_factory) -> Iterator[str]:
    """Of a run with rigid clusters in a field that rises by 1 mT per frame."""
    with served(SmallRun(tmp_path_factory.mktemp("runs") / "small", rigid=True).folder, RISING) as server:
        yield server.url


@pytest.fixture
def view(page, address) -> Driven:
    page.set_viewport_size({"width": 1280, "height": 800})
    return Driven(page, address)


def told(view: Driven) -> dict[str, tuple[str, list[float], list[str]]]:
    """Title, shares [%] and rows by the first word of the title."""
    return {title.split(":")[0]: (title, shares, rows) for title, shares, rows in view.tab.evaluate(TOLD)}


@pytest.mark.parametrize("frame", range(1, FRAMES))
def test_energy_lost_by_each_mechanism(view, frame):
    """The sum of all channels of the row at the time of the frame, and their shares of it, which add up to 100 %.

    Six have a row of their own, the others one together; numbers in rows are rounded to whole percents, widths of at
    most eleven pieces to six digits (5e-5 each).
    """
    view.put(frame=frame)
    title, shares, rows = told(view)["energy lost"]
    lost = [row(frame)[f"lost_{name}"] for name in LOST]
    assert re.fullmatch(r"energy lost: [\d.]+ aJ", title)
    assert float(title.split()[2]) == pytest.approx(sum(lost) / 1e-18, rel=5e-3, abs=0.0)
    assert sum(shares) == pytest.approx(100.0, abs=1e-3) and shares == sorted(shares, reverse=True)
    percents = [int(text.split()[-2]) for text in rows]
    assert percents[:6] == [round(share) for share in shares[:6]]
    assert sum(percents) == pytest.approx(100, abs=0.5 * len(percents))
    assert rows[-1].startswith("others") and len(rows) == 7


def test_gains_are_no_losses(view):
    """A channel that has gained energy has a row with its amount, and no share of what was lost."""
    view.run("app.series.plots.find((p) => p.id === 'losses').lines[0].values.fill(-3e-18)")
    view.put(frame=2)
    _, shares, rows = told(view)["energy lost"]
    assert rows[-1].endswith("gained 3 aJ")
    assert sum(shares) == pytest.approx(100.0, abs=1e-3)


@pytest.mark.parametrize("frame", [0, 5])
def test_field_and_moments(view, frame):
    """B = (1 + frame) mT; Σμ over Σ|μ|, and its component along B, of all grains; arrows point there on the screen.

    The arrow of Σμ is as long as the share, times the foreshortening of its direction: the arrow of B, along z, has
    the share 1 and that of z.
    """
    view.put(frame=frame)
    assert told(view)["field"][0] == f"field: B = {1 + frame} mT"
    moment = grains(positions(frame), frame).moment
    net = moment.sum(0) / np.linalg.norm(moment, axis=1).sum()
    title, shares, rows = told(view)["net moment"]
    assert title == f"net moment: {100 * np.linalg.norm(net):.0f} % of Σ|μ|"
    assert shares == pytest.approx([100 * np.linalg.norm(net)], abs=1e-3)
    assert float(rows[0].split()[0]) == pytest.approx(100 * net[2], rel=0.05, abs=0.0)
    arrow = """(kind) => { const e = document.querySelector(`line.gv-${kind}`);
      return ["x1", "y1", "x2", "y2"].map((a) => Number(e.getAttribute(a))); }"""
    ends = {kind: np.array(view.tab.evaluate(arrow, kind)) for kind in ("field", "moment")}
    to_right, up = np.array(
        view.run("[0, 1].map((r) => [0, 1, 2].map((c) => app.stage.camera.matrixWorldInverse.elements[r + 4 * c]))")
    )
    length = np.abs(ends["field"][1] - ends["field"][3]) / np.abs(up[2])
    for kind, direction in (("field", [0, 0, 1]), ("moment", net)):
        drawn = (ends[kind][2:] - ends[kind][:2]) * [1, -1] / length
        assert drawn == pytest.approx([to_right @ direction, up @ direction], abs=1e-3)


@pytest.mark.parametrize("frame", [0, 4, 7])
def test_clusters_at_rest(view, frame):
    """How many clusters, and grains, are at rest, awake and single, as the frame says."""
    view.put(frame=frame)
    label = np.arange(GRAINS)
    for _ in range(GRAINS):
        for i, j in pairs(frame):
            label[[i, j]] = label[[i, j]].min()
    size = np.bincount(label, minlength=GRAINS)[label]
    rest, names = at_rest(frame), np.unique(label[size > 1])
    resting = sum(bool(rest[label == name].all()) for name in names)
    title, shares, rows = told(view)["rigid clusters (at rest)"]
    assert title == f"rigid clusters (at rest): {resting} of {len(names)}"
    awake, asleep, single = ((~rest) & (size > 1)).sum(), (rest & (size > 1)).sum(), (size == 1).sum()
    assert rows == [f"{awake} awake (contact steps)", f"{asleep} at rest (rigid)", f"{single} single, not counted"]
    assert shares == pytest.approx([100 * awake / GRAINS, 100 * asleep / GRAINS], abs=1e-3)


@pytest.mark.parametrize("screen", SCREENS)
def test_the_values_of_a_grain_leave_the_grain_free(page, address, screen):
    """Whatever grain is chosen in the picture, nothing lies over its centre then but the canvas."""
    page.set_viewport_size(dict(zip(("width", "height"), SCREENS[screen], strict=True)))
    view, seen = Driven(page, address), 0
    for grain in range(GRAINS):
        view.put(grain=grain)
        assert page.locator(".gv-inspector").is_visible()
        x, y = view.pixel_of(grain)
        box = page.locator("canvas.gv-canvas").bounding_box()
        if box["x"] + 2 < x < box["x"] + box["width"] - 2 and box["y"] + 2 < y < box["y"] + box["height"] - 2:
            legend = page.locator(".gv-legend").bounding_box()
            over = (
                legend["x"] <= x <= legend["x"] + legend["width"] and legend["y"] <= y <= legend["y"] + legend["height"]
            )
            seen += 1
            assert "gv-canvas" in page.evaluate(COVER, [x, y]) or over, grain
    assert seen >= GRAINS - 2


def test_a_narrow_page_tells_of_the_frame_without_the_settings(page, address):
    page.set_viewport_size({"width": 400, "height": 840})
    view = Driven(page, address)
    assert view.run("app.page.root.classList.contains('gv-panel-hidden')")
    assert view.run("app.page.glance.getBoundingClientRect().height") > 100.0


def test_settings_are_folded(view):
    """Three choices of the picture are there at once, the other groups open by a click or by Enter."""
    folded = view.tab.locator(".gv-panel details").all()
    assert [one.get_attribute("aria-label") for one in folded] == ["Colour", "Show", "Camera", "Time"]
    assert not any(one.locator("input, select").first.is_visible() for one in folded)
    for name in ("colour", "bonds", "plot"):
        assert view.tab.locator(f"#gv-{name}").is_visible()
    for one, open_it in zip(folded, ("click", "Enter", "click", "Enter"), strict=True):
        summary = one.locator("summary")
        summary.click() if open_it == "click" else summary.press("Enter")
        assert one.locator("input, select").first.is_visible()
