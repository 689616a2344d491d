"""What does not fit together is refused at once: grains and box, kind of engine, components.  Nothing is compiled."""

import pytest

import sand


def problems_of(*args, **options):
    with pytest.raises(sand.BadInput) as found:
        sand.Simulation(*args, **options)
    return found.value.problems


def test_problems_of_box_forces_engine_and_components_are_reported_together():
    """One line each, in this order; none hides another."""
    grains = sand.Grains([[0, 0, "10 um"], ["2 um", 0, 0]], "0.5 um", "silica", moment="1e-17 A m^2")
    forces = [sand.Contact(), sand.Dipoles("3 um")]
    more = {"walls": sand.Wall([0, 0, "-1 um"], [0, 0, 1], "silica"), "driven": sand.Driven([7])}
    found = problems_of(grains, forces, box="5 um", stepping=sand.RigidClusters(), **more)
    parts = [
        "grain 0 lies outside the box",
        "dipoles: cutoff = 3 um exceeds half the box",
        "stepping: without damping no cluster comes to rest",
        "walls: the normal of 'wall1' has a component along z, along which the box is periodic",
        "driven: there is no grain 7",
    ]
    assert len(found) == len(parts)
    assert all(text.startswith(part) for text, part in zip(found, parts, strict=True))


@pytest.mark.parametrize(("damping", "lines"), [({}, 1), ({"damping": "viscoelastic", "viscous_time": 1e-11}, 2)])
def test_walls_are_checked_beside_a_material_without_constants_of_contacts(damping, lines):
    """A grain cut by a wall, whose material lacks surface energy: the overlap at rest is not known, and not asked."""
    bare = sand.Material("bare", density=2e3, young_modulus=1e10, poisson_ratio=0.0, surface_energy=None)
    grains, floor = sand.Grains([[0, 0, 1e-6]], 5e-7, bare), sand.Wall([0, 0, 0.7e-6], [0, 0, 1], "silica")
    found = problems_of(grains, sand.Contact(**damping), walls=floor, driven=sand.Driven([7]))
    assert [text.partition(" has")[0] for text in found[:lines]] == ["material 'bare'"] * lines
    assert found[lines:] == ["driven: there is no grain 7; indices of the 1 grains are 0 … 0"]
