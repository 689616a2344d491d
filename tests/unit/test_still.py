"""Still pictures: what is on the picture is the data.

Pictures are read back as numbers.  A pixel is averaged over 3 × 3 samples, so an edge is known to a third of a pixel,
and a share of a pixel's area to a ninth; areas of discs are known to their circumference times that, which gives the
tolerances below.
"""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

import sand
from sand.analysis.quantities import GRAIN_NAMES, cluster_rank, measured, quantity
from sand.core.errors import BadInput
from sand.view import trace
from sand.view.scene import camera
from sand.view.spheres import Balls, Rods, draw
from sand.view.still import still_picture
from sand.view.style import BIG, SINGLE, rgb
from sand.view.trace import Canvas, Solids

R = 1e-8


class Frame(SimpleNamespace):
    """What a picture needs of a frame."""

    def __len__(self):
        return len(self.radius)


def frame_of(position, pairs=(), radius=R, box=None, **more):
    """A frame of iron grains; forces push 1 nN along the line of centres, one mode of each contact is at its limit."""
    position = np.array(position, float)
    count, pair = len(position), np.array(pairs, dtype=np.uint32).reshape(-1, 2)
    zeros = np.zeros((count, 3))
    box = box or sand.Box.open()
    way = box.nearest(position[pair[:, 0]] - position[pair[:, 1]])
    usual = {
        "position": position,
        "radius": np.broadcast_to(radius, count).astype(float),
        "velocity": zeros,
        "spin": zeros,
        "moment": zeros,
        "mass": np.full(count, 3e-20),
        "material": np.zeros(count, int),
        "materials": ["iron"],
        "pair": pair,
        "force": 1e-9 * way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-300),
        "share": np.tile([-2.0, 1.0, 0.2, 0.1], (len(pair), 1)),
        "box": box,
        "time": 1e-6,
    }
    return Frame(**(usual | more))


def at_pixel(picture, point):
    """Column and row (from below) of a point [m] of the laboratory frame, in pixels, parallel projection."""
    flat = picture.rotation @ point
    left, right, bottom, top = picture.window
    height, width = picture.grains_only.shape[:2]
    return (flat[0] - left) / (right - left) * width, (flat[1] - bottom) / (top - bottom) * height


def alike(picture, colour, least=0.5):
    """(H, W) pixels whose hue is that of a colour: the direction of what differs from grey."""
    rest = picture[..., :3] - picture[..., :3].mean(axis=2, keepdims=True)
    hue = np.asarray(colour) - np.mean(colour)
    size = np.linalg.norm(rest, axis=2) * np.linalg.norm(hue)
    return (picture[..., 3] > 0.5) & ((rest @ hue) > 0.97 * size) & (np.linalg.norm(rest, axis=2) > least * 0.1)


# --- balls -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("view", ["iso", "front", "top", "side", "1,-2,0.4"])
def test_a_sphere_is_a_disc_of_its_size_at_its_place(view):
    """Centre: mean of the disc's pixels by opacity, to 0.1 pixel; radius √(area/π).

    The area is off by less than the circumference × 1/3 sample × 1/√(samples on it): 2πr/3/√(6πr) < 0.5 % of πr².
    """
    frame = frame_of([[3e-8, -2e-8, 5e-8], [-4e-8, 6e-8, -1e-8]], radius=[2e-8, 1.2e-8])
    picture = still_picture(frame, view=view, size=(400, 300), arrows=False, colour="radius")
    scale = 400 / (picture.window[1] - picture.window[0])
    rows, columns = np.mgrid[:300, :400] + 0.5
    for k in range(2):
        x, y = at_pixel(picture, frame.position[k])
        near = np.hypot(columns - x, rows - y) < 1.2 * frame.radius[k] * scale
        alpha = picture.grains_only[..., 3] * near
        if not np.linalg.norm((camera_of(view) @ (frame.position[0] - frame.position[1]))[:2]) > 4e-8:
            continue  # the discs overlap from here: another test's matter
        assert (columns * alpha).sum() / alpha.sum() == pytest.approx(x, rel=0.0, abs=0.1)
        assert (rows * alpha).sum() / alpha.sum() == pytest.approx(y, rel=0.0, abs=0.1)
        assert np.sqrt(alpha.sum() / np.pi) == pytest.approx(frame.radius[k] * scale, rel=0.005, abs=0.0)


def camera_of(view):
    """The rotation of a view, by still_picture itself."""
    return still_picture(frame_of([[0, 0, 0]]), view=view, size=(200, 200)).rotation


def test_views_are_what_they_are_called():
    """From the front x is to the right and z up; from the side y and z; from above x and y."""
    for view, right, up in (("front", 0, 2), ("side", 1, 2), ("top", 0, 1)):
        turn = camera_of(view)
        np.testing.assert_allclose(turn[:2], np.eye(3)[[right, up]], atol=1e-15)
    np.testing.assert_allclose(camera_of("iso"), camera(), atol=1e-15)
    np.testing.assert_allclose(camera_of("0,0,-2")[2], [0, 0, -1], atol=1e-15)


@pytest.mark.parametrize("w", [0.0, 1 / 300.0])
def test_the_nearer_of_two_balls_wins_everywhere(w):
    """Every sample of two balls that run into each other shows the one that its ray meets first.

    Rays are the lines (X(1 − wz), Y(1 − wz), z); both quadratic equations are solved in double precision, and samples
    whose two depths differ by less than 0.01 (the depth has 24 bits of 300) are left out.
    """
    centre, radius = np.array([[-12.0, 3.0, 5.0], [14.0, -2.0, -9.0]]), np.array([40.0, 33.0])
    rods = np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 2))
    canvas = Canvas((120, 160), Solids(centre, radius, *rods, np.eye(3)[:2], np.ones(2)), w)
    rows, columns = np.mgrid[:120, :160]
    x, y = columns + 0.5 - 80, rows + 0.5 - 60
    depth = np.full((2, 120, 160), -np.inf)
    for k in range(2):
        p, d = np.stack([x, y, 0.0 * x]) - centre[k][:, None, None], np.stack([-w * x, -w * y, 1.0 + 0.0 * x])
        a, b, c = (d * d).sum(axis=0), (p * d).sum(axis=0), (p * p).sum(axis=0) - radius[k] ** 2
        met = b * b > a * c
        depth[k][met] = (-b[met] + np.sqrt(b[met] ** 2 - a[met] * c[met])) / a[met]
    met = np.isfinite(depth).any(axis=0)
    with np.errstate(invalid="ignore"):
        clear = met & ~(np.abs(depth[0] - depth[1]) < 0.01)
    r, c = np.nonzero(clear)
    assert clear.sum() > 5000 and (canvas.covered() == met).mean() > 0.9995
    r, c = np.nonzero(clear & canvas.covered())
    which, point, normal = canvas.surface(r, c)
    np.testing.assert_array_equal(which, depth.argmax(axis=0)[r, c])
    np.testing.assert_allclose(point[:, 2], depth.max(axis=0)[r, c], atol=0.01)
    np.testing.assert_allclose(normal, (point - centre[which]) / radius[which, None], atol=1e-3)


@pytest.mark.parametrize("w", [0.0, 1 / 400.0])
def test_rods_are_met_where_they_are(w):
    """Points on a cone and a cylinder fulfil their equations: distance to the axis grows as the girth does.

    Tolerance 0.01 samples: the depth has 24 bits of some hundred samples.
    """
    start, end = (
        np.array([[-60.0, -30.0, -20.0], [10.0, -20.0, 30.0]]),
        np.array([[40.0, 35.0, 25.0], [60.0, 40.0, -30]]),
    )
    girth = np.array([[14.0, 0.0], [6.0, 6.0]])
    balls = np.zeros((0, 3)), np.zeros(0)
    canvas = Canvas((140, 180), Solids(*balls, start, end, girth, np.eye(3)[:2], np.ones(2)), w)
    which, point, normal = canvas.surface(*np.nonzero(canvas.covered()))
    for k in range(2):
        q, axis = point[which == k] - start[k], end[k] - start[k]
        along = q @ axis / (axis @ axis)
        away = np.linalg.norm(q - along[:, None] * axis, axis=1)
        lids = (np.abs(along) < 1e-3) | (np.abs(along - 1.0) < 1e-3)
        expected = girth[k, 0] + (girth[k, 1] - girth[k, 0]) * along
        assert len(q) > 300 and (along > -1e-3).all() and (along < 1.0 + 1e-3).all()
        np.testing.assert_allclose(away[~lids], expected[~lids], atol=0.01)
    facing = (normal * np.column_stack([-w * point[:, 0], -w * point[:, 1], np.ones(len(point))])).sum(axis=1)
    assert (facing > -0.1).all()  # nothing is seen from behind


def test_perspective_shows_what_is_nearer_larger():
    """Two equal grains one behind the other: the nearer disc is larger by the ratio of distances, nearly."""
    frame = frame_of([[0, -2e-7, -5e-8], [0, 2e-7, 5e-8]])
    flat, deep = (
        still_picture(frame, view="front", size=(400, 400), arrows=False, perspective=on).grains_only[..., 3]
        for on in (False, True)
    )
    assert flat[:200].sum() == pytest.approx(flat[200:].sum(), rel=0.01, abs=0.0)
    assert deep[:200].sum() > 1.5 * deep[200:].sum()


def test_chunks_bound_the_memory(monkeypatch):
    """Ten thousand grains: no more samples than MOST_SAMPLES are looked at in one go, and the picture is full."""
    rng = np.random.default_rng(5)
    looked = []
    balls = Canvas._balls

    def watched(self, which, x, y):
        looked.append(which.size * x.shape[2] * y.shape[1])
        return balls(self, which, x, y)

    monkeypatch.setattr(Canvas, "_balls", watched)
    grains = Balls(
        rng.normal(size=(10_000, 3)), np.full(10_000, 0.03), np.full((10_000, 3), 0.5), np.zeros((10_000, 3))
    )
    picture = draw(grains, (-3.2, 3.2, -2.0, 2.0), 800, 500)
    assert max(looked) <= trace.MOST_SAMPLES < sum(looked)
    assert picture[200:300, 350:450, 3].mean() > 0.95


def test_a_ball_larger_than_the_picture_is_cut_into_squares():
    """A ball that fills the picture is drawn, in pieces that are within what is looked at in one go."""
    one = Balls(np.zeros((1, 3)), np.ones(1), np.full((1, 3), 0.5), np.zeros((1, 3)))
    assert (draw(one, (-0.4, 0.4, -0.3, 0.3), 400, 300)[..., 3] == 1.0).all()


# --- colours -----------------------------------------------------------------------------------------


def test_clusters_have_their_colours():
    """At each grain's centre is the hue of its cluster, the largest first; single grains are grey."""
    position = np.array([[0, 0, 0], [2, 0, 0], [4, 0, 0], [0, 0, 5], [2, 0, 5], [6, 0, 5]]) * R
    picture = still_picture(frame_of(position, [(0, 1), (1, 2), (3, 4)]), view="front", size=(500, 400))
    for k, colour in enumerate([BIG[0]] * 3 + [BIG[1]] * 2 + [SINGLE]):
        x, y = at_pixel(picture, position[k])
        patch = picture.grains_only[int(y) - 3 : int(y) + 3, int(x) - 3 : int(x) + 3]
        if colour == SINGLE:
            assert np.ptp(patch[..., :3], axis=2).max() < 0.08
        else:
            assert alike(patch, rgb(colour)).all()


def test_a_colour_leads_back_to_its_number():
    """Speeds are in the order of the colours on the bar, whose ends are the least and the most; of arrows no trace."""
    frame = frame_of(np.arange(5)[:, None] * [3 * R, 0, 0], velocity=np.arange(1, 6)[:, None] * [0.0, 0.0, 2.0])
    picture = still_picture(frame, colour="speed", view="front", size=(500, 300))
    bar = next(axes for axes in picture.axes if axes.get_label() == "bar")
    assert bar.get_ylim() == pytest.approx((2.0, 10.0), rel=1e-6, abs=0.0)
    from sand.view.colouring import SEQUENTIAL

    expected = SEQUENTIAL(np.linspace(0.0, 1.0, 5))[:, :3]
    for k in range(5):
        x, y = at_pixel(picture, frame.position[k])
        assert alike(picture.grains_only[int(y) : int(y) + 2, int(x) : int(x) + 2], expected[k]).all()


def test_quantities_are_what_they_say():
    """Each of the table by its formula: cosines, speeds, energies with spin, ranks of clusters."""
    frame = frame_of(
        np.eye(3) * 3 * R,
        [(1, 2)],
        velocity=np.diag([1.0, 2.0, 3.0]),
        spin=np.diag([1e8, 0.0, 0.0]),
        moment=np.array([[0, 0, 2.0], [0, 1.0, 0], [0, 1.0, 1.0]]) * 1e-18,
    )
    inertia = 0.4 * 3e-20 * R**2
    energy = 0.5 * 3e-20 * np.array([1.0, 4.0, 9.0]) + 0.5 * inertia * np.array([1e16, 0, 0])
    np.testing.assert_allclose(measured(frame, "kinetic_energy"), energy)
    np.testing.assert_array_equal(measured(frame, "speed"), [1, 2, 3])
    np.testing.assert_array_equal(measured(frame, "coordination"), [0, 1, 1])
    np.testing.assert_array_equal(measured(frame, "cluster"), [1, 0, 0])
    np.testing.assert_allclose(measured(frame, "alignment"), [1.0, 2 / 5**0.5, 3 / 10**0.5])
    np.testing.assert_allclose(measured(frame, "field_alignment", np.array([0, 0, 1e-3])), [1.0, 0.0, 0.5**0.5])
    np.testing.assert_allclose(measured(frame, "load"), 1e-9)
    np.testing.assert_array_equal(measured(frame, "mode"), [2])
    np.testing.assert_array_equal(cluster_rank(4, np.array([(2, 3)])), [1, 2, 0, 0])
    assert all(quantity(name).meaning for name in GRAIN_NAMES)
    with pytest.raises(
        BadInput, match="field_alignment is not known: no grain has a moment, or there is no outside field"
    ):
        measured(frame, "field_alignment")
    with pytest.raises(BadInput, match="did you mean 'speed'"):
        quantity("sped")


# --- moments and contacts ----------------------------------------------------------------------------


@pytest.mark.parametrize("angle", [20.0, 110.0, 200.0, 290.0])
def test_an_arrow_points_along_its_moment(angle):
    """The arrow's pixels, its head being heavier, lie along the moment.

    Their longest axis is the moment's to 2°, a pixel over the arrow's length, and the third moment along it, which the
    thicker head decides, has its sign.
    """
    direction = np.array([np.cos(np.radians(angle)), 0.0, np.sin(np.radians(angle))])
    frame = frame_of([[0, 0, 0]], moment=direction[None] * 1e-18)
    with_arrow, bare = (
        still_picture(frame, view="front", size=(400, 400), arrows=on).grains_only for on in (True, False)
    )
    rows, columns = np.nonzero(np.abs(with_arrow - bare)[..., :3].max(axis=2) > 0.2)
    flat = np.column_stack([columns, rows]) + 0.5 - np.array(at_pixel_of_centre(frame))
    flat = flat[np.hypot(*flat.T) < 400]
    across = np.array([-direction[2], direction[0]])
    along, off = flat @ direction[[0, 2]], flat @ across
    assert np.abs(np.degrees(0.5 * np.arctan2(2 * (along * off).mean(), (along**2).mean() - (off**2).mean()))) < 2.0
    assert np.ptp(off[along > 0.15 * along.max()]) > 2.0 * np.ptp(off[along < -0.15 * along.max()])


def at_pixel_of_centre(frame):
    """Where the only grain of a frame is, in pixels."""
    return at_pixel(still_picture(frame, view="front", size=(400, 400)), frame.position[0])


def test_a_contact_through_a_face_is_drawn_at_both():
    """Two grains that touch through a face of the box, cut: a collar at each face, none between the grains.

    Red marks the stretch mode at its limit, on blue grains: red pixels lie within a radius of the two points where the
    grains touch, at ±L/2 along x.
    """
    box = sand.Box.periodic("200 nm")
    share = np.array([[1.0, 0.0, 0.0, 0.0]])
    frame = frame_of([[0.901e-7, 0, 0], [-0.901e-7, 0, 0]], [(0, 1)], box=box, share=share, velocity=np.eye(3)[:2])
    how = {"view": "front", "size": (600, 500), "bonds": "mode", "arrows": False, "colour": "material"}
    cut = still_picture(frame, whole=False, **how)
    red = alike(cut.grains_only, rgb("#D55E00"), 1.5)
    columns = np.nonzero(red)[1] + 0.5
    faces = [at_pixel(cut, np.array([x, 0.0, 0.0]))[0] for x in (-1e-7, 1e-7)]
    reach = R * 600 / (cut.window[1] - cut.window[0])
    away = np.abs(columns[:, None] - np.array(faces))
    assert ((away < reach).sum(axis=0) > 10).all() and (away.min(axis=1) < reach).all()
    whole = still_picture(frame, **how)
    columns = np.nonzero(alike(whole.grains_only, rgb("#D55E00"), 1.5))[1]
    assert 3 < np.ptp(columns) < 2 * reach


def test_box_edges_are_hidden_by_grains_in_front():
    """An edge runs behind a grain that is nearer to the eye: at the grain's centre is the grain."""
    box = sand.Box.periodic("100 nm")
    frame = frame_of([[-4.6e-8, -4.2e-8, 0.0]], box=box)  # before the left edge at the back
    picture = still_picture(frame, view="0.1,-1,0.0", size=(400, 400), arrows=False)
    line = np.array([0.48, 0.51, 0.55])
    corner = picture.grains_only[:, :, 3] > 0.5
    assert corner.sum() > 500
    x, y = at_pixel(picture, np.array([-5e-8, 5e-8, 0.0]))
    there = picture.grains_only[int(y), int(x), :3]
    gone = np.linalg.norm(at_pixel(picture, frame.position[0]) - np.array([x, y]))
    radius = R * 400 / (picture.window[1] - picture.window[0])
    assert gone < radius  # the edge does pass behind
    assert np.abs(there - line).max() > 0.05 and np.ptp(there) < 0.1


# --- the picture -------------------------------------------------------------------------------------


@pytest.mark.parametrize("dark", [False, True])
def test_grounds(dark):
    """Transparent: nothing where there is nothing, the grain opaque; otherwise the ground of the style."""
    frame = frame_of([[0, 0, 0]])
    clear = np.asarray(still_picture(frame, size=(300, 200), dark=dark, transparent=True).image())
    solid = np.asarray(still_picture(frame, size=(300, 200), dark=dark).image())
    assert clear.shape == solid.shape == (200, 300, 4)
    x, y = at_pixel(still_picture(frame, size=(300, 200)), np.zeros(3))
    assert clear[5, 295, 3] == 0 and clear[200 - int(y), int(x), 3] == 255
    assert (solid[..., 3] == 255).all()
    assert tuple(solid[5, 295, :3]) == ((16, 20, 24) if dark else (255, 255, 255))


def test_the_same_frame_the_same_bits():
    """Two pictures of a frame agree byte for byte, as PNG, PDF and SVG."""
    from sand.view.plots import picture_bytes

    frame = frame_of(np.arange(4)[:, None] * [2 * R, 0, 0], [(0, 1)], moment=np.eye(4, 3) * 1e-18)
    for form in ("png", "pdf", "svg"):
        one, other = (picture_bytes(still_picture(frame, size=(300, 200), bonds="load"), form) for _ in range(2))
        assert one == other


def test_scale_bar_and_caption():
    """The bar is as long as it says; time and grains are told; the field's arrow is there if there is a field."""
    from sand.view.style import pretty

    picture = still_picture(frame_of([[0, 0, 0]]), field=(0.0, 0.0, 1e-3))
    (bar,) = [line for line in picture.axes[0].get_lines() if line.get_gid() == "scale"]
    assert pretty(float(np.ptp(bar.get_xdata())), "m") in [text.get_text() for text in picture.axes[0].texts]
    told = [text.get_text() for text in picture.texts]
    assert "t = 1 µs" in told and any("1 grain of iron" in text for text in told)
    inside = [text.get_text() for axes in picture.axes for text in axes.texts]
    assert "B" in inside
    none = [text.get_text() for axes in still_picture(frame_of([[0, 0, 0]])).axes for text in axes.texts]
    assert "B" not in none


def test_one_cluster_by_itself():
    """The second largest cluster alone: its grains, no box, what it is of how many."""
    frame = frame_of(np.arange(6)[:, None] * [2 * R, 0, 0], [(0, 1), (1, 2), (4, 5)], box=sand.Box.periodic("1 um"))
    picture = still_picture(frame, cluster=2, size=(300, 200))
    np.testing.assert_array_equal(picture.scene.number, [4, 5])
    assert picture.scene.box.is_open and "2 of 6 grains" in [text.get_text() for text in picture.texts]
    with pytest.raises(BadInput, match="cluster 3: there are 2"):
        still_picture(frame, cluster=3)


def test_all_mistakes_are_told():
    """One line for each thing that cannot be."""
    with pytest.raises(BadInput) as told:
        still_picture(frame_of([[0, 0, 0]]), colour="sped", bonds="loud", view="botom", size=(10, 1000))
    assert len(told.value.problems) == 4
    for view in ("0,0,0", "1,2", "nan,1,1"):
        with pytest.raises(BadInput, match="direction to the eye"):
            still_picture(frame_of([[0, 0, 0]]), view=view)
    with pytest.raises(BadInput, match="no grain with a finite position"):
        still_picture(frame_of([[np.nan, 0, 0]]))
    with pytest.raises(BadInput, match="alignment is not known: no grain has a moment"):
        still_picture(frame_of([[0, 0, 0]]), colour="alignment")


def test_rods_join():
    """Joined rods are all of them, in order."""
    one = Rods(np.zeros((1, 3)), np.ones((1, 3)), np.ones((1, 2)), np.ones((1, 3)), np.ones(1))
    both = Rods.joined(one, dataclasses.replace(one, lit=np.zeros(1)))
    np.testing.assert_array_equal(both.lit, [1.0, 0.0])
