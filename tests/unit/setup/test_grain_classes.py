"""Gases of several classes: laws of radii, mixtures, charges of both signs, aggregates."""

import numpy as np
import pytest
from scipy import stats

import sand
from sand.basics.constants import BOLTZMANN
from sand.config.build import simulation_of
from sand.config.case import check_case
from sand.setup import GrainClass, gas, gas_with_contacts
from sand.simulation.serialise import case_of

BOX = "2 um"
CHARGED = [
    {"share": 0.25, "material": "iron", "moment": "material", "charge": "1.6e-19 C"},
    {"share": 0.75, "material": "silica", "charge": "-1.6e-19 C"},
]
CHAINS = [{"number": 5, "kind": "chain", "grains": 4, "charge": 1e-19}, {"number": 3, "radius": "20 nm"}]


def test_radii_follow_the_law_and_materials_the_fractions():
    """ln r of lognormal(20 nm, 0.2) is normal within 3 σ: Kolmogorov–Smirnov p > 1e-3; 0.7 N and 0.3 N grains."""
    grains = gas(1000, "10 um", radius="lognormal(20 nm, 0.2)", material={"silica": 0.7, "iron": 0.3}, seed=2)
    assert stats.kstest(np.log(grains.radius / 20e-9) / 0.2, stats.truncnorm(-3.0, 3.0).cdf).pvalue > 1e-3
    names = np.array([m.name for m in grains.materials])[grains.material]
    assert (names == "silica").sum() == 700 and (names == "iron").sum() == 300
    density = np.array([m.density for m in grains.materials])[grains.material]
    assert grains.mass == pytest.approx(density * 4.0 / 3.0 * np.pi * grains.radius**3, rel=1e-12, abs=0.0)
    assert abs(np.corrcoef(grains.radius, density)[0, 1]) < 4.0 / np.sqrt(1000)


def test_charges_of_both_signs_by_class():
    """Grains are in the order of the classes, with material, charge and moment of their class."""
    grains = gas(20, BOX, radius="10 nm", classes=CHARGED, seed=1)
    names = [grains.materials[k].name for k in grains.material]
    assert names == ["iron"] * 5 + ["silica"] * 15
    assert grains.charge.tolist() == [1.6e-19] * 5 + [-1.6e-19] * 15
    size = np.linalg.norm(grains.moment, axis=1)
    assert size[:5] == pytest.approx(200.0 * grains.mass[:5], rel=1e-12, abs=0.0) and not size[5:].any()
    assert (grains.body_moment == grains.moment).all()
    assert len(np.unique(grains.moment[:5, 0])) == 5


def test_one_class_is_the_gas_without_classes():
    """The same streams of random numbers: every quantity has the same bits."""
    given = {"radius": "10 nm", "material": "iron", "moment": "material", "temperature": 100.0, "seed": 3}
    plain, classes = gas(30, BOX, **given), gas(30, BOX, classes=[GrainClass(share=1.0)], **given)
    for name in ("position", "velocity", "spin", "moment"):
        assert (getattr(plain, name) == getattr(classes, name)).all()


def test_the_seed_determines_every_class():
    """Bit for bit; another law of one class does not change the radii of the other."""
    classes = [
        {"number": 5, "radius": "lognormal(10 nm, 0.3)"},
        {"number": 5, "radius": "power law(-3.5, 5 nm, 20 nm)"},
    ]
    one, two = (gas(None, BOX, material="silica", classes=classes, seed=4) for _ in range(2))
    other = gas(None, BOX, material="silica", classes=[{"number": 5, "radius": "12 nm"}, classes[1]], seed=4)
    assert (one.radius == two.radius).all() and (one.position == two.position).all()
    assert (other.radius[5:] == one.radius[5:]).all() and (other.radius[:5] == 12e-9).all()


@pytest.mark.parametrize(("spins", "share"), [("kT/2", 0.5), ("equipartition", 1.5), ("none", 0.0)])
def test_aggregates_move_as_rigid_bodies_at_the_temperature(spins, share):
    """All kinetic energy of the grains is (3/2)(M − 1) kT + M × share kT; no strain: (xi − xj)·(vi − vj) = 0.

    König's theorem: Σ ½ m v² + ½ I ω² over the grains is the energy of the rigid motion of the M members.  The momentum
    is zero.  Rounding: 1e-12 of the energy, and of |x| |v| for the strain.
    """
    grains = gas(None, BOX, radius="10 nm", material="silica", temperature="300 K", spins=spins, classes=CHAINS, seed=5)
    energy = 0.5 * (grains.mass * (grains.velocity**2).sum(axis=1) + grains.inertia * (grains.spin**2).sum(axis=1))
    assert energy.sum() == pytest.approx((1.5 * 7 + 8 * share) * BOLTZMANN * 300.0, rel=1e-12, abs=0.0)
    momentum = (grains.mass[:, None] * grains.velocity).sum(axis=0)
    assert np.abs(momentum).max() < 1e-12 * (grains.mass[:, None] * np.abs(grains.velocity)).sum()
    box = sand.Box.periodic(BOX)
    for k in range(5):
        x, v, w = (getattr(grains, name)[4 * k : 4 * k + 4] for name in ("position", "velocity", "spin"))
        apart, moving = box.nearest(x[:, None] - x), v[:, None] - v
        assert np.abs((apart * moving).sum(axis=2)).max() < 1e-12 * 6e-8 * max(np.abs(v).max(), 1e-30)
        assert (w == w[0]).all() and bool(w.any()) is bool(share)


def test_rotation_is_divided_among_the_principal_axes():
    """Canonical draws of a chain of four: ⟨I ω²⟩ along and across the chain is kT/3 each for "kT/2".

    With (2/5) m r² for the rotation of each grain about its centre, I = 4 (2/5) m r² along the chain and Σ m x² more
    across it.  Over 400 members and one or two axes the mean has a relative standard error of √(2/400) = 7 %; limits of
    four errors.
    """
    classes = [{"number": 400, "kind": "chain", "grains": 4}]
    given = {"radius": "10 nm", "material": "silica", "temperature": 300.0, "exact_temperature": False}
    grains = gas(None, "3 um", classes=classes, seed=6, **given)
    x = grains.position.reshape(400, 4, 3)
    along = sand.Box.periodic("3 um").nearest(x[:, 1] - x[:, 0])
    spacing = np.linalg.norm(along, axis=1, keepdims=True)
    w = grains.spin[::4]
    parallel = (w * along / spacing).sum(axis=1)
    m, own = grains.mass[0], 4.0 * grains.inertia[0]
    across = own + m * 2.0 * (0.5**2 + 1.5**2) * spacing[0, 0] ** 2
    unit = BOLTZMANN * 300.0 / 3.0
    assert own * (parallel**2).mean() / unit == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / 400))
    assert 0.5 * across * ((w**2).sum(axis=1) - parallel**2).mean() / unit == pytest.approx(1.0, abs=4.0 / 20.0)
    # directions of the chains are isotropic: cosines with z are uniform
    assert stats.kstest(along[:, 2] / spacing[:, 0], "uniform", args=(-1, 2)).pvalue > 1e-3


def test_aggregates_keep_their_contacts_and_touch_nothing_else():
    """Chains have 3 contacts each at the equilibrium overlap, to the rounding of positions in the box, 1e-22 m."""
    grains = gas(None, "0.4 um", radius="10 nm", material="silica", classes=CHAINS, seed=7)
    pairs, overlap = grains.touching(sand.Box.periodic("0.4 um"))
    assert {(int(i), int(j)) for i, j in pairs} == {(4 * k + n, 4 * k + n + 1) for k in range(5) for n in range(3)}
    alone = sand.setup.chain(2, radius="10 nm", material="silica").touching(sand.Box.open())[1][0]
    assert overlap == pytest.approx(alone, abs=1e-21)
    assert grains.charge.tolist() == [1e-19] * 20 + [0.0] * 3
    assert (np.abs(grains.position) <= 0.2e-6).all()


def test_case_file_and_script_give_the_same_grains():
    """The same words: [[grains.classes]] and classes=[…]; case.toml describes the same gas."""
    content = {
        "run": {"until": "1 ns", "seed": 5},
        "box": {"periodic": BOX},
        "materials": {"dust": {"like": "silica", "density": 2000.0}},
        "grains": {"radius": "10 nm", "material": {"dust": 0.5, "ice": 0.5}, "temperature": 50.0, "classes": CHAINS},
        "forces": {"contact": {}},
    }
    simulation = simulation_of(check_case(content, "some.toml"), None)
    mixed = {sand.SILICA.but(name="dust", density=2000.0): 0.5, sand.ICE: 0.5}
    script = gas(None, BOX, radius="10 nm", material=mixed, temperature=50.0, classes=CHAINS, seed=5)
    again = simulation_of(check_case(case_of(simulation, 1e-9, np.inf), "case.toml"), None)
    for name in ("position", "velocity", "spin", "charge", "radius", "mass"):
        assert (getattr(simulation.start, name) == getattr(script, name)).all(), name
        assert (getattr(again.start, name) == getattr(script, name)).all(), name


@pytest.mark.compiled("contacts")
def test_members_from_a_frame_keep_strained_contacts(tmp_path):
    """Three copies of the largest cluster of a frame have three times its contact energy, and its internal shape.

    The energy of contacts is a function of overlaps and displacements, which rotate with the body.  Overlaps follow
    from positions of 2 µm with errors of 4e-22 m, relative to an overlap of 1e-11 m: 1e-9 with a margin.
    """
    body = sand.setup.chain(4, radius="20 nm", material="silica")
    body.arrays.velocity[:, 1] = 0.05, 0.08, -0.02
    shifted = body.position + np.array([0.98e-6, 0.0, 0.0])  # across the boundary
    body.arrays.position[...] = sand.Box.periodic(BOX).wrap(shifted).T
    source = sand.Simulation(body, [sand.Contact()], box=BOX, out=tmp_path / "run", frame_every="1 ns")
    source.run(until="2 ns")
    classes = [{"number": 3, "kind": "file", "file": str(tmp_path / "run"), "frame": -1}]
    with pytest.raises(sand.BadInput, match="gas_with_contacts"):
        gas(None, BOX, classes=classes)
    content = {"run": {"steps": 5}, "box": {"periodic": BOX}, "grains": {"classes": classes}, "forces": {"contact": {}}}
    with pytest.raises(sand.BadInput, match="holds the run that the grains come from"):
        simulation_of(check_case(content, "copies.toml"), tmp_path / "run", overwrite=True)
    assert len(simulation_of(check_case(content, "copies.toml"), None).contacts["pair"]) == 9
    start = gas_with_contacts(None, BOX, classes=classes, temperature="10 K", seed=1)
    assert np.sort(start.contacts.pair, axis=1).tolist() == [
        [4 * k + n, 4 * k + n + 1] for k in range(3) for n in range(3)
    ]
    copies = sand.Simulation(start.grains, [sand.Contact()], box=start.box, contacts=start.contacts)
    copies.run(steps=1)
    for column in ("normal", "sliding", "rolling"):
        assert source.ledger[column][-1] != 0.0
        assert copies.ledger[column][0] == pytest.approx(3.0 * source.ledger[column][-1], rel=1e-6, abs=0.0), column


@pytest.mark.compiled("contacts")
def test_a_mixture_resumes_bit_for_bit(tmp_path):
    """The order of materials of the checkpoint is kept: 20 steps and 20 more equal 40."""
    content = {
        "run": {"steps": 40, "seed": 5},
        "box": {"periodic": "0.3 um"},
        "grains": {"number": 12, "radius": "lognormal(10 nm, 0.2)", "material": {"silica": 0.5, "ice": 0.5}},
        "forces": {"contact": {}},
    }
    content["grains"]["temperature"] = 100.0
    case = check_case(content, "some.toml")
    whole = simulation_of(case, tmp_path / "whole")
    whole.run(steps=40)
    part = simulation_of(case, tmp_path / "part")
    part.run(steps=20)
    rest = sand.resume(tmp_path / "part")
    rest.run(steps=20)
    assert (rest.grains.position == whole.grains.position).all()
    assert [m.name for m in rest.grains.materials] == [m.name for m in whole.grains.materials]
