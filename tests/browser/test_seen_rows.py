"""Numbers of clusters and distances on the screen are those that `sand.analysis` finds in the file."""

import numpy as np
import pytest

from sand.analysis.clusters import aggregate_moments, cluster_labels, unwrapped
from sand.analysis.fractal import FEWEST, correlation_dimension
from sand.analysis.shape import gyration_radius
from sand.basics.errors import BadInput

from .looking import SOURCES, View, agree, numbers, size


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize(
    ("kind", "grains"), [("hundred", (0, 30, 40, 60, 88)), ("two", (1,)), ("ten-thousand", (4321,))]
)
def test_rows_of_a_cluster(page, shows, kind, grains, source):
    """N, contacts, mass, centre of mass, r_g, moment, alignment |Σμ|/Σ|μ| and D_f, also of clusters cut by faces.

    The centre is of the whole cluster, up to lengths of the box.  Sums of moments in half precision are off by 5e-4 of
    what is summed, divided by the alignment.
    """
    view = View(page, shows(kind), source, shade=0)
    for k in (0, len(view.shown.frames) // 2, len(view.shown.frames) - 1):
        frame = view.go(k)
        labels, mass = cluster_labels(len(frame), frame.pair), np.asarray(frame.mass, float)
        moments, alignments = aggregate_moments(frame.moment, labels)
        for grain in {"two": (1,), "hundred": (0, 30, 40, 60, 88), "ten-thousand": (4321,)}[kind]:
            view.set(grain=grain)
            page.wait_for_selector("caption:text-is('cluster')")
            who = np.flatnonzero(labels == labels[grain])
            held = np.searchsorted(who, frame.pair[labels[frame.pair[:, 0]] == labels[grain]])
            place = unwrapped(frame.position[who], held, frame.box)
            row = view.rows()["cluster"]
            assert int(row["grains N"]) == len(who) and int(row["contacts"]) == len(held)
            agree(row["mass"], mass[who].sum())
            agree(row["radius of gyration"], gyration_radius(place, mass[who]))
            centre = frame.box.nearest(numbers(row["centre"]) - np.average(place, axis=0, weights=mass[who]))
            assert np.abs(centre).max() < 1e-3 * max(frame.drawn)
            moment, summed = moments[labels[grain]], np.linalg.norm(frame.moment[who], axis=1).sum()
            assert np.abs(numbers(row["moment"]) - moment).max() < 6e-3 * np.linalg.norm(moment) + 5e-4 * summed
            size(row["moment"], float(np.linalg.norm(moment)))
            agree(row["|Σμ| / Σ|μ|"], alignments[labels[grain]])
            check_dimension(view, place)


def check_dimension(view: View, place: np.ndarray) -> None:
    """D ± error, with three digits and one, or why there is none."""
    cell = "tr:has(th:text-is('fractal dimension')) td"
    view.page.wait_for_selector(f"{cell}:not(:text-is('…'))")
    text = view.rows()["cluster"]["fractal dimension"]
    try:
        found = correlation_dimension(place)
    except BadInput:
        assert "±" not in text and len(text) > 20
        return
    assert len(place) >= FEWEST
    value, error = (float(part) for part in text.split(" ± "))
    assert abs(value - found.value) < 5e-3 and abs(error - found.error) <= 0.5 * 10 ** np.floor(np.log10(found.error))


@pytest.mark.parametrize(
    ("told", "words"),
    [
        ({"value": 1.784, "error": None}, "1.78 ± not known"),
        ({"value": None, "error": None}, "not known"),
        ({"value": 1.784, "error": 0.02}, "1.78 ± 0.02"),
    ],
)
def test_a_dimension_that_is_not_a_number(page, shows, told, words):
    """JSON has null for it; the row says so, and not that it is infinite."""
    view = View(page, shows("hundred"), shade=0)
    page.evaluate("(told) => { sandView.source.dimension = async () => told; }", told)
    view.set(grain=0)
    cell = page.locator("tr:has(th:text-is('fractal dimension')) td")
    cell.filter(has_not_text="…").wait_for()
    assert cell.inner_text() == words


@pytest.mark.parametrize("source", SOURCES)
def test_distance_between_two_grains(page, shows, source):
    """By the nearest image, of centres and of surfaces; the ruler on the screen says the same."""
    shown, rng = shows("hundred"), np.random.default_rng(3)
    view = View(page, shown, source, shade=0)
    for k in (0, 3, 5):
        frame = view.go(k)
        pairs = [tuple(rng.choice(100, 2, replace=False).tolist()) for _ in range(8)] + [tuple(frame.pair[0].tolist())]
        for i, j in pairs:
            view.set(ends=f"{i}-{j}")
            row = view.rows()["distance"]
            way = frame.box.nearest(frame.position[j] - frame.position[i])
            apart = float(np.linalg.norm(way))
            gap = apart - frame.radius[i] - frame.radius[j]
            agree(row["between centres"], apart, 1e-4)
            agree(row["along x, y, z"], way)
            # the gap is a difference: single precision of places in the box, 6e-8 of it
            told = numbers(row["overlap" if gap < 0.0 else "between surfaces"])[0]
            assert abs(told - abs(gap)) < 1e-3 * abs(gap) + 2e-7 * max(frame.drawn)
            view.page.evaluate("() => sandView.stage.draw()")
            agree(page.text_content(".gv-ruler-name"), apart)
