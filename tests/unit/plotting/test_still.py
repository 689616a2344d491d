"""Still pictures: the drawn pixels agree with the data.

Pictures are read back as numbers.  A pixel is the mean of 3 × 3 samples, so an edge is known to a third of a pixel
and an area to its circumference times that, which gives the tolerances below.
"""

import numpy as np
import pytest

import sand
from sand.basics.errors import BadInput
from sand.plotting.render.scene import camera_rotation
from sand.plotting.render.still import contact_share, still_picture
from sand.plotting.style import rgb

from ..synthetic_frames import R, at_pixel, frame_of, pixels_of_hue


@pytest.mark.slow
@pytest.mark.parametrize("view", ["iso", "front", "top", "side", "1,-2,0.4"])
def test_a_sphere_is_a_disc_of_its_size_at_its_place(view):
    """Centre: opacity-weighted mean of the disc's pixels, to 0.1 pixel; radius √(area/π).

    The area error is less than circumference × 1/3 sample × 1/√(samples on it): 2πr/3/√(6πr) < 0.5 % of πr².
    """
    frame = frame_of([[3e-8, -2e-8, 5e-8], [-4e-8, 6e-8, -1e-8]], radius=[2e-8, 1.2e-8])
    picture = still_picture(frame, view=view, size=(400, 300), arrows=False, colour="radius")
    scale = 400 / (picture.window[1] - picture.window[0])
    rows, columns = np.mgrid[:300, :400] + 0.5
    for k in range(2):
        x, y = at_pixel(picture, frame.position[k])
        near = np.hypot(columns - x, rows - y) < 1.2 * frame.radius[k] * scale
        alpha = picture.grains_only[..., 3] * near
        if not np.linalg.norm((picture.rotation @ (frame.position[0] - frame.position[1]))[:2]) > 4e-8:
            continue  # the discs overlap from here, which another test covers
        assert (columns * alpha).sum() / alpha.sum() == pytest.approx(x, rel=0.0, abs=0.1)
        assert (rows * alpha).sum() / alpha.sum() == pytest.approx(y, rel=0.0, abs=0.1)
        assert np.sqrt(alpha.sum() / np.pi) == pytest.approx(frame.radius[k] * scale, rel=0.005, abs=0.0)


def camera_of(view):
    """The rotation of a view, by still_picture itself."""
    return still_picture(frame_of([[0, 0, 0]]), view=view, size=(200, 200)).rotation


@pytest.mark.slow
def test_named_views():
    """From the front x is to the right and z up; from the side y and z; from above x and y."""
    for view, right, up in (("front", 0, 2), ("side", 1, 2), ("top", 0, 1)):
        turn = camera_of(view)
        np.testing.assert_allclose(turn[:2], np.eye(3)[[right, up]], atol=1e-15)
    np.testing.assert_allclose(camera_of("iso"), camera_rotation(), atol=1e-15)
    np.testing.assert_allclose(camera_of("0,0,-2")[2], [0, 0, -1], atol=1e-15)


def test_perspective_shows_what_is_nearer_larger():
    """Two equal grains one behind the other: the ratio of disc sizes is about that of distances."""
    frame = frame_of([[0, -2e-7, -5e-8], [0, 2e-7, 5e-8]])
    flat, deep = (
        still_picture(frame, view="front", size=(400, 400), arrows=False, perspective=on).grains_only[..., 3]
        for on in (False, True)
    )
    assert flat[:200].sum() == pytest.approx(flat[200:].sum(), rel=0.01, abs=0.0)
    assert deep[:200].sum() > 1.5 * deep[200:].sum()


@pytest.mark.slow
@pytest.mark.parametrize("angle", [20.0, 200.0, *(pytest.param(a, marks=pytest.mark.validate) for a in (110.0, 290.0))])
def test_an_arrow_points_along_its_moment(angle):
    """The principal axis of the arrow's pixels is along the moment to 2°, a pixel over its length.

    The third moment along it has the moment's sign, because the head is thicker.
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
    """Pixel coordinates of the only grain of a frame."""
    return at_pixel(still_picture(frame, view="front", size=(400, 400)), frame.position[0])


@pytest.mark.slow
def test_a_contact_through_a_face_is_drawn_at_both():
    """Two grains in contact through a face of the box, cross-section: a collar at each face, none between them.

    Red marks stretching at its limit, on blue grains: red pixels are within a radius of the two contact points, at ±L/2
    along x.
    """
    box = sand.Box.periodic("200 nm")
    share = np.array([[1.0, 0.0, 0.0, 0.0]])
    frame = frame_of([[0.901e-7, 0, 0], [-0.901e-7, 0, 0]], [(0, 1)], box=box, share=share, velocity=np.eye(3)[:2])
    how = {"view": "front", "size": (600, 500), "bonds": "mode", "arrows": False, "colour": "material"}
    cut = still_picture(frame, whole=False, **how)
    red = pixels_of_hue(cut.grains_only, rgb("#D55E00"), 1.5)
    columns = np.nonzero(red)[1] + 0.5
    faces = [at_pixel(cut, np.array([x, 0.0, 0.0]))[0] for x in (-1e-7, 1e-7)]
    reach = R * 600 / (cut.window[1] - cut.window[0])
    away = np.abs(columns[:, None] - np.array(faces))
    assert ((away < reach).sum(axis=0) > 10).all() and (away.min(axis=1) < reach).all()
    whole = still_picture(frame, **how)
    columns = np.nonzero(pixels_of_hue(whole.grains_only, rgb("#D55E00"), 1.5))[1]
    assert 3 < np.ptp(columns) < 2 * reach


def test_box_edges_are_hidden_by_grains_in_front():
    """An edge passes behind a grain: at the grain's centre is the grain."""
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
    assert gone < radius  # the edge passes behind the grain
    assert np.abs(there - line).max() > 0.05 and np.ptp(there) < 0.1


@pytest.mark.parametrize("whole", [False, True])
def test_a_tilted_box_is_a_parallelepiped(whole):
    """Its edges along z are (T, 0, L); all grains are in it, x − T z/L within L/2, each at one of its own images."""
    side, tilt = 1e-7, 4e-8
    x = side * np.random.default_rng(1).uniform(-0.5, 0.5, (40, 3))
    frame = frame_of(x, box=sand.Box.periodic(side, tilt=tilt))
    scene = still_picture(frame, size=(200, 200), whole=whole).scene
    along = np.array([b - a for a, b, axis, _ in scene.edges() if axis == 2])
    np.testing.assert_allclose(along, np.tile([tilt, 0.0, side], (4, 1)), atol=1e-12 * side)
    flat = scene.position - np.outer(scene.position[:, 2], [tilt / side, 0.0, 0.0])
    assert np.abs(flat).max() <= (0.5 + 1e-12) * side
    moved = (scene.position - x)[:, 0] / side
    np.testing.assert_allclose(moved, np.rint(moved), atol=1e-9)
    assert (moved != 0.0).any()  # the rectangular box has these grains beside the parallelepiped


@pytest.mark.slow
@pytest.mark.parametrize("dark", [False, True])
def test_backgrounds(dark):
    """Transparent: empty pixels have opacity 0, the grain is opaque; otherwise the background of the style."""
    frame = frame_of([[0, 0, 0]])
    clear = np.asarray(still_picture(frame, size=(300, 200), dark=dark, transparent=True).image())
    solid = np.asarray(still_picture(frame, size=(300, 200), dark=dark).image())
    assert clear.shape == solid.shape == (200, 300, 4)
    x, y = at_pixel(still_picture(frame, size=(300, 200)), np.zeros(3))
    assert clear[5, 295, 3] == 0 and clear[200 - int(y), int(x), 3] == 255
    assert (solid[..., 3] == 255).all()
    assert tuple(solid[5, 295, :3]) == ((16, 20, 24) if dark else (255, 255, 255))


@pytest.mark.slow
def test_pixels_per_inch_change_the_print_alone():
    """At another number of pixels per inch the grains have the same pixels, and texts the same share of the picture."""
    frame = frame_of([[0, 0, 0], [3e-8, 0, 0]])
    usual, fine = (still_picture(frame, size=(400, 300), dpi=dpi) for dpi in (160, 600))
    assert (usual.grains_only == fine.grains_only).all()
    assert fine.image().size == (400, 300) and fine.image().info["dpi"][0] == pytest.approx(600, rel=0.0, abs=0.02)
    difference = np.abs(np.asarray(usual.image(), float) - np.asarray(fine.image(), float))[..., :3].max(axis=2)
    assert (difference > 64).mean() < 0.02  # edges of letters
    with pytest.raises(sand.BadInput, match="pixels per inch must be from 50 to 1200"):
        still_picture(frame, dpi=10)


@pytest.mark.slow
def test_pictures_are_reproducible():
    """Two pictures of a frame are equal byte for byte, as PNG, PDF and SVG."""
    from sand.plotting.run_figure import figure_bytes

    frame = frame_of(np.arange(4)[:, None] * [2 * R, 0, 0], [(0, 1)], moment=np.eye(4, 3) * 1e-18)
    for form in ("png", "pdf", "svg"):
        one, other = (figure_bytes(still_picture(frame, size=(300, 200), bonds="load"), form) for _ in range(2))
        assert one == other


@pytest.mark.slow
def test_scale_bar_and_caption():
    """The bar has its stated length; time and grains are given; the field's arrow exists with a field."""
    from sand.plotting.style import format_si

    picture = still_picture(frame_of([[0, 0, 0]]), size=(400, 300), field=(0.0, 0.0, 1e-3))
    (bar,) = [line for line in picture.axes[0].get_lines() if line.get_gid() == "scale"]
    assert format_si(float(np.ptp(bar.get_xdata())), "m") in [text.get_text() for text in picture.axes[0].texts]
    message = [text.get_text() for text in picture.texts]
    assert "t = 1 µs" in message and any("1 grain of iron" in text for text in message)
    inside = [text.get_text() for axes in picture.axes for text in axes.texts]
    assert "B" in inside
    none = [
        text.get_text() for axes in still_picture(frame_of([[0, 0, 0]]), size=(400, 300)).axes for text in axes.texts
    ]
    assert "B" not in none


def test_one_cluster_by_itself():
    """The second largest cluster alone: its grains, no box, its rank and the number of clusters."""
    frame = frame_of(np.arange(6)[:, None] * [2 * R, 0, 0], [(0, 1), (1, 2), (4, 5)], box=sand.Box.periodic("1 um"))
    picture = still_picture(frame, cluster=2, size=(300, 200))
    np.testing.assert_array_equal(picture.scene.number, [4, 5])
    assert picture.scene.box.is_open and "2 of 6 grains" in [text.get_text() for text in picture.texts]
    with pytest.raises(BadInput, match="cluster 3: there are 2"):
        still_picture(frame, cluster=3)


def test_positions_that_are_not_finite_are_refused():
    """A frame without a place for the eye."""
    with pytest.raises(BadInput, match="no grain with a finite position"):
        still_picture(frame_of([[np.nan, 0, 0]]))


@pytest.mark.parametrize(("r", "s"), [(10.0, 25.0), (25.0, 10.0), (10.0, 10.0), (1.0, 100.0)])
def test_contacts_are_where_the_spheres_intersect(r, s):
    """A point of the circle in which two spheres intersect is r from one centre and s from the other.

    At the share f of d it has the distance h from the axis with h² = r² − f² d² = s² − (1 − f)² d²; touching spheres
    have f = r/(r + s).  Both sides are of the size of s²: 16 roundings of the larger radius squared.
    """
    for overlap in (0.0, 0.01, 0.1):
        d = (r + s) - overlap * min(r, s)
        f = contact_share(np.array([d]), np.array([r]), np.array([s]))[0]
        assert r**2 - (f * d) ** 2 == pytest.approx(
            s**2 - ((1 - f) * d) ** 2, rel=0.0, abs=16 * 2**-52 * max(r, s) ** 2
        )
        assert overlap or f == pytest.approx(r / (r + s), rel=1e-13, abs=0.0)
    assert contact_share(np.array([0.0]), np.array([r]), np.array([s]))[0] in (0.0, 0.5, 1.0)
