"""Bars on the screen are the contacts of the file, in colours of what they bear; across a face both halves are there.

Grains are 0.3 of their size and bars 0.45 radii of the smaller grain thick, so that bars are seen from end to end.
"""

import numpy as np
import pytest

from sand.basics.box import Box

from .eye import Eye
from .looking import SOURCES, View, agree, numbers, size
from .test_seen_grains import BACKGROUND, NEAR

SMALL = {"shade": 0, "arrows": 0, "box": 0, "size": 0.3, "ortho": 1}
BAR = 0.45
LOOK = (0.0, 0.0, 0.0, 0.52, -0.74, 0.43, 0.0, 0.0, 1.0, 60.0)


def pieces_of(frame, unit: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Begin and end (P, 3) of bars, in the page's unit, and the contact (P,) each belongs to; parts across faces.

    Parts end where the spheres intersect: |x − a|² − r² = |x − b|² − s², a share (d² + r² − s²) / (2 d²) of the way.
    """
    place, box = frame.position / unit, Box(tuple(v if v is None else v / unit for v in frame.box.lengths))
    i, j = frame.pair.T
    straight = place[j] - place[i]
    way = box.nearest(straight)
    cut = np.linalg.norm(way - straight, axis=1) > 1.0
    r, s = frame.radius[i] / unit, frame.radius[j] / unit
    share = 0.5 + 0.5 * (r**2 - s**2) / (way**2).sum(1)
    middle = place[j] - (1.0 - share)[:, None] * way
    begin = np.concatenate([place[i], place[j][cut]])
    end = np.concatenate([place[i] + np.where(cut, share, 1.0)[:, None] * way, middle[cut]])
    return begin, end, np.concatenate([np.arange(len(i)), np.flatnonzero(cut)])


def thickness(view: View, contact: np.ndarray) -> np.ndarray:
    """Of bars of these contacts (half), in the page's unit."""
    return BAR * view.radii[view.frame.pair[contact]].min(axis=1)


def clear(eye: Eye, spot: np.ndarray, own: int, pieces: tuple, view: View) -> bool:
    """True if nothing but bars of the contact `own` is near the pixel at which a place is seen."""
    begin, end, contact = pieces
    (at,), _ = eye.pixels(spot)
    if (at < 12).any() or (at > [eye.wide - 12, eye.high - 12]).any():
        return False
    a, b = eye.pixels(begin)[0], eye.pixels(end)[0]
    way = b - a
    share = np.clip(((at - a) * way).sum(1) / np.maximum((way**2).sum(1), 1e-9), 0.0, 1.0)
    off = np.linalg.norm(at - a - share[:, None] * way, axis=1) - thickness(view, contact) * eye.scale
    grains = np.linalg.norm(eye.pixels(view.positions)[0] - at, axis=1) - 0.3 * view.radii * eye.scale
    return bool((off[contact != own] > 2.0).all() and (grains > 2.0).all())


def from_across(view: View, c: int, pieces: tuple) -> tuple[Eye, np.ndarray] | None:
    """A camera that sees the first piece of a contact from across with nothing before it, and a pixel; or None."""
    begin, end, _ = pieces
    spot, way = begin[c] + 0.6 * (end[c] - begin[c]), end[c] - begin[c]
    one = np.cross(way, [0.31, 0.53, 0.79])
    one, two = one / np.linalg.norm(one), np.cross(way, one) / np.linalg.norm(np.cross(way, one))
    high, wide = view.page.evaluate("() => [sandView.stage.canvas.height, sandView.stage.canvas.width]")
    for angle in np.arange(12) * np.pi / 6:
        look = (*spot, *(np.cos(angle) * one + np.sin(angle) * two), *(way / np.linalg.norm(way)), 16.0)
        if clear(Eye(look, wide, high, True), spot, c, pieces, view):
            eye = view.look(*look)
            return eye, eye.pixels(spot)[0][0]
    return None


def rgb(text: str) -> np.ndarray:
    return np.array([int(text[k : k + 2], 16) for k in (1, 3, 5)])


def push(frame) -> np.ndarray:
    """Force along the line of centres (C,) [N], above 0 where it pushes: F·n, n from the second grain to the first."""
    apart = frame.box.nearest(frame.position[frame.pair[:, 0]] - frame.position[frame.pair[:, 1]])
    return (frame.force * apart).sum(1) / np.linalg.norm(apart, axis=1)


def at_limit(share: np.ndarray) -> int:
    """The mode whose limit is reached (of a pull, only above), −1: none."""
    sizes = np.array([share[0], *np.abs(share[1:])])
    return int(np.nanargmax(sizes)) if np.nanmax(sizes, initial=-1.0) >= 0.999 else -1


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("kind", ["load", "mode"])
def test_colours_of_contacts(page, shows, kind, source):
    """A bar seen from across is lit as the middle of a grain is: its pixel has its colour within NEAR levels.

    By load that is the entry of the diverging palette (64) at (F/F_max + 1)/2, F_max the largest |F| of all frames; the
    next entry is allowed, too, for what lies within 1e-3 of the border.
    """
    shown = shows("hundred")
    view = View(page, shown, source, look=LOOK, bonds=kind, **SMALL)
    table = np.array(page.evaluate("() => sandView.manifest.palettes.diverging"))
    named = page.evaluate("() => [sandView.manifest.colours.within, ...sandView.manifest.colours.modes]")
    top = max(np.abs(push(frame)).max() for frame in shown.frames)
    for k in (0, 3, 5):
        frame, seen = view.go(k), set()
        pieces, load, tried = pieces_of(frame, shown.unit), push(frame), 0
        drawn = np.array(page.evaluate("() => [...sandView.world.pieces.colour]")).reshape(-1, 4)[:, :3]
        owner = page.evaluate("() => [...sandView.world.pieces.contact]")
        assert sorted(owner) == sorted(pieces[2].tolist())
        for c in range(len(frame.pair)):
            mode = at_limit(frame.share[c])
            share = 0.5 + 0.5 * load[c] / top
            places = np.clip(np.floor((share + np.array([-1e-3, 0.0, 1e-3])) * 64), 0, 63).astype(int)
            allowed = table[places] if kind == "load" else rgb(named[mode + 1])[None]
            given = drawn[np.flatnonzero(np.array(owner) == c)]
            assert all((np.abs(allowed - colour).max(1) == 0).any() for colour in given), (k, c)
            if (mode in seen and kind == "mode") or tried > 8 or (found := from_across(view, c, pieces)) is None:
                continue
            x, y = found[1].astype(int)
            assert np.abs(view.image()[y, x] - given[0]).max() <= NEAR, (k, c)
            tried += 1
            seen.add(mode)
        assert tried > 8 if kind == "load" else len(seen) == 5


@pytest.mark.parametrize("source", SOURCES)
def test_bars_are_where_contacts_are_and_nowhere_else(page, shows, source):
    """All that is drawn lies within the outlines of bars and grains, wider by a pixel and a half; so nothing crosses
    the box where a contact goes through a face.  A tenth and nine tenths along every half of such a contact there is a
    bar: its axis is behind its flat ends, too.
    """
    shown = shows("hundred")
    view = View(page, shown, source, look=LOOK, bonds="plain", **SMALL)
    for k in (0, 3, 5):
        frame = view.go(k)
        eye, image, pieces = view.eye(), view.image(), pieces_of(frame, shown.unit)
        begin, end, contact = pieces
        a, b = eye.pixels(begin)[0], eye.pixels(end)[0]
        rows, columns = np.nonzero((image != BACKGROUND).any(-1))
        points = np.stack([columns, rows], axis=1) + 0.5
        way = b - a
        share = ((points[:, None] - a) * way).sum(-1) / (way**2).sum(-1)
        off = np.linalg.norm(points[:, None] - a - np.clip(share, 0.0, 1.0)[..., None] * way, axis=-1)
        near = (off < thickness(view, contact) * eye.scale + 1.5).any(1)
        centres = eye.pixels(view.positions)[0]
        apart = np.linalg.norm(points[:, None] - centres, axis=-1)
        near |= (apart < 0.3 * view.radii * eye.scale + 1.5).any(1)
        assert near.all(), f"frame {k}: {np.sum(~near)} pixels are drawn where there is neither bar nor grain"
        cut = np.flatnonzero(np.bincount(contact) == 2)
        assert len(cut) >= 3
        for p in np.flatnonzero(np.isin(contact, cut)):
            for part in (0.1, 0.5, 0.9):
                ((x, y),) = eye.pixels(begin[p] + part * (end[p] - begin[p]))[0].astype(int)
                if 0 <= x < eye.wide and 0 <= y < eye.high:
                    assert (image[y, x] != BACKGROUND).any(), (k, p)


@pytest.mark.parametrize("source", SOURCES)
def test_collars_swallow_no_grain(page, shows, source):
    """Grains of 10 nm beside such of 25 nm, at true size, seen from across: a collar is in front of both from the
    contact to a = r − √(r² − R²) on either side, R = 0.45 of the smaller radius; beyond, the grain is.

    Both surfaces are looked at on the axis, at 0.6 a and 1.4 a; collars are grey, grains are not.
    """
    shown = shows("unequal")
    view = View(page, shown, source, bonds="plain", look=(*np.zeros(3), 0, -1, 0, 0, 0, 1, 12.0), **SMALL | {"size": 1})
    frame = view.frame
    place, radius = frame.position / shown.unit, frame.radius / shown.unit
    grey = []
    for c, (i, j) in enumerate(frame.pair):
        (half,) = thickness(view, np.array([c]))
        way = (place[j] - place[i]) / np.linalg.norm(place[j] - place[i])
        apart = np.linalg.norm(place[j] - place[i])
        middle = place[i] + (0.5 * apart + 0.5 * (radius[i] ** 2 - radius[j] ** 2) / apart) * way
        eye = view.look(*middle, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0, 3.0)
        image = view.image()
        for side, r in ((-1, radius[i]), (1, radius[j])):
            reach = r - np.sqrt(r**2 - half**2)
            for part in (0.6, 1.4):
                ((x, y),) = eye.pixels(middle + side * part * reach * way)[0].astype(int)
                grey.append((bool(np.ptp(image[y, x].astype(int)) < 30), part == 0.6))
    assert len(grey) == 4 * len(frame.pair) == 16 and all(seen == collar for seen, collar in grey), grey


@pytest.mark.parametrize("source", SOURCES)
def test_a_click_chooses_the_contact_that_is_there(page, shows, source):
    """And its numbers are those of the file; halves across a face choose the same contact."""
    shown = shows("hundred")
    view = View(page, shown, source, look=LOOK, bonds="plain", **SMALL)
    for k in (0, 3, 5):
        frame, tried, halves = view.go(k), 0, 0
        pieces, load = pieces_of(frame, shown.unit), push(frame)
        cut = np.bincount(pieces[2]) == 2
        order = np.argsort(~cut, kind="stable")
        for c in order:
            if tried >= 10 or (found := from_across(view, c, pieces)) is None:
                continue
            i, j = frame.pair[c]
            row = view.click(*found[1].astype(int))[f"contact {i}–{j}"]
            assert row["grains"] == f"{i} and {j}"
            agree(row["overlap"], frame.overlap[c])
            agree(row["first touch"], frame.formed[c])
            # a component of a vector in half precision is off by 5e-4 of the vector
            assert abs(numbers(row["normal force"])[0] - load[c]) < 1e-3 * np.linalg.norm(frame.force[c])
            assert ("push" if load[c] > 0 else "pull") in row["normal force"]
            agree(row["force"], frame.force[c], 5e-3)
            size(row["force"], float(np.linalg.norm(frame.force[c])))
            for m, mode in enumerate(("stretch", "slide", "roll", "twist")):
                told = row[f"{mode} / limit"]
                assert told == "not known" if np.isnan(frame.share[c, m]) else abs(
                    numbers(told)[0] - frame.share[c, m]) < 2e-3  # fmt: skip
            tried, halves = tried + 1, halves + cut[c]
        assert tried == 10 and halves >= 1
        page.keyboard.press("Escape")
