"""Grains on the screen are those of the file: every pixel shows the grain that a ray through it meets first.

Rays, pixels and spheres are worked out in numpy from the camera's ten numbers (`eye.Eye`) and the trajectory; pixels
within one of an edge are left out, so that outlines agree within a pixel.

Shading multiplies a colour by light and adds white shine (at most 0.16 of full, 41 levels): a pixel of a grain of
colour c is f c + s.  The residual of that, with whole s and rounded levels, is at most 0.5 + 0.5; 1.5 are allowed.
"""

import numpy as np
import pytest

from sand.analysis.clusters import cluster_labels
from sand.plotting.render.scene import make_scene

from .eye import Eye, inside
from .looking import SOURCES, View, agree, size

BACKGROUND = (251, 250, 247)
BARE = {"shade": 0, "arrows": 0, "bonds": "off", "box": 0}
"""Nothing but grains, without shade from neighbours and haze."""
OBLIQUE = (0.52, -0.74, 0.43, 0.0, 0.0, 1.0)
LOOKS = {"two": (0.0, 0.0, 0.0, *OBLIQUE, 5.0), "hundred": (1.0, -2.0, 0.5, *OBLIQUE, 52.0)}
FRAMES = {"two": (0, 1, 2), "hundred": (0, 3, 5), "ten-thousand": (0, 1, 2)}
RESIDUAL = 1.5
NEAR = 12


def off_colour(pixels: np.ndarray, colours: np.ndarray) -> np.ndarray:
    """By how many levels pixels (P, 3) are off f c + s with the best f and 0 ≤ s ≤ 41, (P,); 0 where one is full."""
    best = np.full(len(pixels), np.inf)
    c = np.maximum(colours, 1).astype(float)
    for shine in range(42):
        rest = pixels - float(shine)
        f = np.maximum((rest * c).sum(1) / (c * c).sum(1), 0.0)
        best = np.minimum(best, np.abs(rest - f[:, None] * c).max(1))
    return np.where(pixels.max(1) >= 255, 0.0, best)


def alone(eye: Eye, places: np.ndarray, radii: np.ndarray, margin: int = 1) -> np.ndarray:
    """Grains that are seen at their own middle's pixel and those around it, well inside the picture."""
    seen = eye.spheres(places, radii)
    seen[~inside(seen, margin)] = -1
    pixels, _ = eye.pixels(places)
    room = np.flatnonzero(np.all((pixels > 8) & (pixels < [eye.wide - 8, eye.high - 8]), axis=1))
    x, y = pixels[room].astype(int).T
    return room[seen[y, x] == room]


def check_row(view: View, tables: dict, grain: int) -> None:
    """The numbers of a grain are those of the file."""
    frame, row = view.frame, tables[f"grain {grain}"]
    agree(row["position"], frame.position[grain])
    agree(row["radius"], frame.radius[grain])
    agree(row["mass"], frame.mass[grain])
    assert row["material"] == frame.materials[frame.material[grain]]
    for name in ("velocity", "spin", "moment"):
        vector = np.asarray(getattr(frame, name)[grain], float)
        # components have three digits, half of the last one of the largest is 5e-3 of it at most; the numbers of a page
        # in one file have half precision, 2^-11
        agree(row[name], vector, 5e-3 + 2.0**-11) if vector.any() else None
        size(row[name], float(np.linalg.norm(vector)))
    assert row["spin"].split("\n")[0].split(" ")[1:] == ["rad/s"], "angles take no prefix"
    assert int(row["contacts"]) == (frame.pair == grain).sum()
    v, w = np.linalg.norm(frame.velocity[grain]), np.linalg.norm(frame.spin[grain])
    energy = 0.5 * frame.mass[grain] * (float(v) ** 2 + 0.4 * frame.radius[grain] ** 2 * float(w) ** 2)
    agree(row["kinetic energy"], energy, 2e-3)  # squares have twice the error


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("ortho", [0, 1])
@pytest.mark.parametrize("kind", ["two", "hundred"])
def test_pixels_show_the_grain_that_a_ray_meets(page, shows, kind, ortho, source):
    view = View(page, shows(kind), source, look=LOOKS[kind], ortho=ortho, **BARE)
    for k in FRAMES[kind]:
        view.go(k)
        seen = view.eye().spheres(view.positions, view.radii)
        sure = inside(seen)
        empty, full = sure & (seen < 0), sure & (seen >= 0)
        assert full.sum() > 0.03 * seen.size and len(np.unique(seen[full])) > 0.8 * len(view.radii)
        for colour in ("cluster", "speed"):  # by speed, neighbours within a cluster differ
            view.set(colour=colour)
            image, painted = view.image(), view.painted()
            assert (image[empty] == BACKGROUND).all(), "something is drawn where there is no grain"
            assert (image[full] != BACKGROUND).any(1).all(), "there is no grain where one must be"
            off = off_colour(image[full], painted[seen[full]])
            assert off.max() <= RESIDUAL, f"frame {k}: {np.mean(off > RESIDUAL):.2%} of the pixels have another colour"


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("ortho", [0, 1])
@pytest.mark.parametrize("kind", ["two", "hundred"])
def test_the_rim_of_a_grain(page, shows, kind, ortho, source):
    """At 0.9 radii from its middle a pixel is of the grain, at 1.15 it is not (where nothing else is near).

    Grains are at least 12 pixels wide, so a pixel is less than the tenth that is asked about.
    """
    look = (*view_target(kind), *OBLIQUE, 5.0 if kind == "two" else 40.0)
    view, tried = View(page, shows(kind), source, look=look, ortho=ortho, **BARE), 0
    for k in FRAMES[kind]:
        view.go(k)
        eye, image = view.eye(), view.image()
        pixels, depth = eye.pixels(view.positions)
        reach = view.radii * eye.scale * (1.0 if ortho else 2.0 * eye.height / depth)
        for i in range(len(view.radii)):
            apart = np.linalg.norm(pixels - pixels[i], axis=1) - 1.1 * reach - 1.25 * reach[i]
            if (np.delete(apart, i) < 2.0).any() or reach[i] < 6.0:
                continue
            if (pixels[i] < 30).any() or (pixels[i] > [eye.wide - 30, eye.high - 30]).any():
                continue
            tried += 1
            for angle in np.arange(8) * np.pi / 4:
                way = reach[i] * np.array([np.cos(angle), np.sin(angle)])
                at, beyond = (np.floor(pixels[i] + share * way).astype(int) for share in (0.9, 1.15))
                assert (image[at[1], at[0]] != BACKGROUND).any(), (k, i)
                assert (image[beyond[1], beyond[0]] == BACKGROUND).all(), (k, i)
    assert tried >= (0 if kind == "two" else 6)


def view_target(kind: str) -> tuple[float, float, float]:
    return LOOKS[kind][:3]


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize(("kind", "ortho"), [("two", 0), ("hundred", 0), ("hundred", 1), ("ten-thousand", 0)])
def test_a_click_chooses_the_grain_that_is_there(page, shows, kind, ortho, source):
    """And its numbers are those of the file, to the digits shown (1e-3)."""
    shown, rng = shows(kind), np.random.default_rng(2)
    look = LOOKS.get(kind, (0.0, 0.0, 0.0, *OBLIQUE, 160.0))
    view = View(page, shown, source, look=look, ortho=ortho, **BARE)
    for k in FRAMES[kind]:
        view.go(k)
        eye, image, painted = view.eye(), view.image(), view.painted()
        pixels, _ = eye.pixels(view.positions)
        free = alone(eye, view.positions, view.radii)
        assert len(free) >= min(len(view.radii), 20 if kind != "two" else 1)
        for i in rng.choice(free, min(len(free), 17 if kind == "ten-thousand" else 12), replace=False):
            x, y = pixels[i].astype(int)
            check_row(view, view.click(x, y), i)
            assert off_colour(image[y, x][None], painted[i][None])[0] <= RESIDUAL
        view.page.keyboard.press("Escape")


@pytest.mark.parametrize("source", SOURCES)
def test_ten_thousand_grains_cover_what_they_must(page, shows, source):
    """From afar grains are discs: where a ray meets any there is one, and nowhere else, pixels at edges left out."""
    view = View(page, shows("ten-thousand"), source, look=(0.0, 0.0, 0.0, *OBLIQUE, 160.0), **BARE)
    for k in FRAMES["ten-thousand"]:
        view.go(k)
        seen, drawn = view.eye().spheres(view.positions, view.radii), (view.image() != BACKGROUND).any(-1)
        covered = seen >= 0
        assert covered.mean() > 0.05
        assert not drawn[~covered & inside(covered)].any()
        assert drawn[covered & inside(seen)].all()


@pytest.mark.parametrize("source", SOURCES)
def test_clusters_have_their_own_colours_and_keep_them(page, shows, source):
    """Grains of one cluster of the file have one colour; the largest five have five; colours stay as clusters grow.

    In frame 3 the two largest meet: the one of 26 grains keeps its colour, the one of 14 takes it.  A picture looked at
    along −from has light of 1.01 at the middle of a grain; within the pixel there (0.07 radii) it changes by 0.04 at
    most, so that the pixel is the colour within NEAR = 0.05 of full light, 12 levels.
    """
    view = View(page, shows("hundred"), source, look=LOOKS["hundred"], ortho=1, **BARE)
    kept = {}
    for k in range(6):
        frame = view.go(k)
        eye, image, painted = view.eye(), view.image(), view.painted()
        labels = cluster_labels(len(frame), frame.pair)
        count = np.bincount(labels)
        for label in range(labels.max() + 1):
            assert len(np.unique(painted[labels == label], axis=0)) == 1
        largest = np.argsort(-count, kind="stable")[:5]
        assert len({tuple(painted[labels == label][0]) for label in largest}) == 5
        assert len(np.unique(painted[count[labels] == 1], axis=0)) == 1
        for member in (0, 40, 56, 68, 76, 82):  # the first grains of clusters that live through all frames
            assert kept.setdefault(member, tuple(painted[member])) == tuple(painted[member]), (k, member)
        assert (tuple(painted[26]) == kept[0]) == (k >= 3)
        pixels, _ = eye.pixels(view.positions)
        for i in alone(eye, view.positions, view.radii):
            x, y = pixels[i].astype(int)
            assert np.abs(image[y, x] - painted[i]).max() <= NEAR, (k, i)


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("palette", ["cividis", "viridis"])
def test_colours_of_a_quantity(page, shows, palette, source):
    """Colour by speed: the palette's entry at (v − low)/(high − low) of 64, low and high percentiles over all frames.

    A value within 1e-3 of the border between two entries may have either.  On the screen within NEAR, as above.
    """
    import matplotlib

    shown = shows("hundred")
    view = View(page, shown, source, look=LOOKS["hundred"], ortho=1, colour="speed", palette=palette, **BARE)
    every = np.concatenate([np.linalg.norm(np.asarray(f.velocity, float), axis=1) for f in shown.frames])
    low, high = (np.percentile(every, p, method=m) for p, m in ((2.0, "lower"), (98.0, "higher")))
    table = np.rint(255 * matplotlib.colormaps[palette](np.linspace(0, 1, 64))[:, :3])
    for k in FRAMES["hundred"]:
        frame = view.go(k)
        share = np.clip((np.linalg.norm(np.asarray(frame.velocity, float), axis=1) - low) / (high - low), 0, 1)
        allowed = [table[np.clip(np.floor((share + d) * 64), 0, 63).astype(int)] for d in (-1e-3, 0.0, 1e-3)]
        eye, image, painted = view.eye(), view.image(), view.painted()
        assert (np.min([np.abs(painted - a).max(1) for a in allowed], axis=0) == 0).all()
        pixels, _ = eye.pixels(view.positions)
        free = alone(eye, view.positions, view.radii)
        assert len(free) > 20
        for i in free:
            x, y = pixels[i].astype(int)
            assert np.abs(image[y, x] - painted[i]).max() <= NEAR, (k, i)


@pytest.mark.parametrize("source", SOURCES)
def test_clusters_are_whole_at_first_as_in_still_pictures(page, shows, source):
    """Places are those of `sand plot`, a cluster as a whole by lengths of the box where its middle is at a face.

    Places in single precision are off by 6e-8 of the box.
    """
    view, cut = View(page, shows("hundred"), source, whole=1), 0
    assert page.evaluate("() => sandView.state.setting('whole').initial")
    for k in FRAMES["hundred"]:
        frame = view.go(k)
        places = np.array(page.evaluate("() => [...sandView.picture.positions]")).reshape(-1, 3) * view.shown.unit
        drawn, side = make_scene(frame, frame.pair, frame.box).position, np.array(frame.drawn)
        boxes = (places - drawn) / side
        assert np.abs(boxes - np.rint(boxes)).max() < 1e-6
        ends = np.rint(boxes)[frame.pair]
        assert (ends[:, 0] == ends[:, 1]).all(), "a cluster is cut"
        cut += (np.abs(places - frame.position) > 0.5 * side).any(1).sum()
    assert cut > 0
