"""Kinds of outcomes by the masses of fragments, growth efficiency, numbers of fragments."""

import pytest

import sand
from sand.analysis.collision_kinds import KINDS, collision_kind, fragment_numbers, growth_efficiency


@pytest.mark.parametrize(
    ("fragments", "changed", "kind", "efficiency"),
    [
        ([120], 0.0, "sticking", 1.0),
        ([119, 1], 0.1, "sticking", 0.95),  # a twentieth of the projectile does not count
        ([120], 0.11, "restructuring", 1.0),
        ([118, 2], 0.5, "mass transfer", 0.9),
        ([100, 20], 0.0, "bouncing", 0.0),
        ([99, 21], 0.9, "bouncing", -0.05),
        ([98, 22], 0.0, "erosion", -0.1),
        ([102, 18], 0.0, "mass transfer", 0.1),
        ([100, 10, 10], 0.3, "mass transfer", 0.0),  # the projectile broke up, and left nothing
        ([61, 59], 0.9, "erosion", -1.95),
        ([60, 60], 0.9, "fragmentation", -2.0),
        ([1] * 120, 1.0, "fragmentation", -4.95),
    ],
)
def test_kinds_of_fragments(fragments, changed, kind, efficiency):
    """100 grains hit by 20, in any order and unit: by the definitions, with f = (N_largest − N_target)/N_projectile."""
    for first, second in ((100.0, 20.0), (20.0, 100.0)):
        assert collision_kind(first, second, fragments[::-1], changed) == kind
        assert collision_kind(3e-18 * first, 3e-18 * second, [3e-18 * n for n in fragments], changed) == kind
        assert growth_efficiency(first, second, max(fragments)) == pytest.approx(efficiency, rel=1e-12, abs=1e-12)
    assert kind in KINDS


def test_equal_bodies():
    """Of 50 + 50 grains, growth is mass transfer and any loss fragmentation: the target is half of all mass."""
    assert collision_kind(50.0, 50.0, [60, 40], 1.0) == "mass transfer"
    assert collision_kind(50.0, 50.0, [49, 40, 11], 1.0) == "fragmentation"
    assert collision_kind(1.0, 1.0, [1, 1], 0.0) == "bouncing"
    assert collision_kind(1.0, 1.0, [1, 1], 0.0, touched=False) == "miss"
    assert collision_kind(1.0, 1.0, [1, 1], 0.0, touched=None) == "undecided"


def test_numbers_of_fragments():
    """Fragments with at least n grains per collision, by hand; the largest of each collision is left out."""
    grains, number = fragment_numbers([(40, 3, 1, 1), (35, 5, 3, 2)])
    assert grains.tolist() == [1, 2, 3, 5]
    assert number.tolist() == [3.0, 2.0, 1.5, 0.5]
    assert fragment_numbers([(2, 1)], without=0)[1].tolist() == [2.0, 1.0]


def test_wrong_masses():
    """One line."""
    with pytest.raises(sand.BadInput, match="must be above 0"):
        growth_efficiency(1.0, 0.0, 1.0)
    with pytest.raises(sand.BadInput, match="has no collision"):
        fragment_numbers([])
