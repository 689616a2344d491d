"""Presets of papers: what they imply, compared with numbers that other papers quote, and how they are chosen."""

import math

import pytest

import sand
from sand.basics.material import COMMON, PAPERS, PRESETS, contact_settings
from sand.config.case import check_case
from sand.theory import contact, paper_table

ROWS = {row.preset: row for row in paper_table()}
WADA, SEIZINGER = "ice (Wada et al. 2013)", "silica (Seizinger et al. 2012)"


def case(**tables):
    """The case of a gas of ten grains with further tables."""
    base = {
        "run": {"until": "1 ns"},
        "box": {"periodic": "9 um"},
        "grains": {"number": 10, "radius": "0.1 um", "material": "mine"},
    }
    return check_case(base | tables, "case.toml")


@pytest.mark.validates(
    "published figure",
    "20 √(E_break/m) of the presets is the critical speed that Wada et al. (2013) quote",
)
def test_critical_speeds_of_papers(record_bound):
    """20 √(E_break/m) of grains of 0.1 µm is 76.5 m/s for ice, 7.6 m/s for silica (Wada et al. 2013).

    To the digits that the paper quotes. These follow from γ, E, ν, ρ and r₀, thus test all of them but ξ_c.
    """
    for name, speed, digit in ((WADA, 76.5, 0.05), ("silica (Wada et al. 2013)", 7.6, 0.05)):
        row = ROWS[name]
        mass = row.density * 4.0 / 3.0 * math.pi * row.radius**3
        found = 20.0 * math.sqrt(row.break_energy / mass)
        record_bound(f"speed [m/s] for {speed} of the paper", found, least=speed - digit, most=speed + digit)


@pytest.mark.validates("published figure", "E_roll of the preset is that which Kataoka et al. (2013) quote")
def test_rolling_energy_of_kataoka(record_bound):
    """E_roll = 12π²γRξ_c = 4.74e-9 erg (Kataoka et al. 2013), to the digits that the paper quotes; R = r₀/2."""
    row = ROWS["ice (Kataoka et al. 2013)"]
    record_bound("E_roll [J] for 4.74e-16 J of the paper", row.roll_energy, least=4.735e-16, most=4.745e-16)
    by_hand = 6.0 * math.pi**2 * row.surface_energy * row.radius * row.rolling_limit
    assert row.roll_energy == pytest.approx(by_hand, rel=1e-12, abs=0.0)


def test_material_file_of_seizinger():
    """Materials/Silicate.mat of their program: r₀ [cm], ρ [g/cm³], γ [erg/cm²], ν, E [dyn/cm²], ξ_c [cm], and factors.

    Not what the program takes without a file, 25 erg/cm² and factors of 1.
    """
    row = ROWS[SEIZINGER]
    found = row.radius, row.density, row.surface_energy, row.poisson_ratio, row.young_modulus, row.rolling_limit
    expected = (6e-5 * 1e-2, 2.65 * 1e3, 20 * 1e-3, 0.17, 5.4e11 * 0.1, 2e-7 * 1e-2)
    assert found == pytest.approx(expected, rel=1e-12, abs=0.0)
    assert contact_settings(SEIZINGER) == {"roll_factor": 8.0, "slide_factor": 2.5}


def test_factor_of_rolling():
    """A contact with `roll_factor` m needs m times the work against friction: k_r R ξ_c is the moment, rolled by π."""
    row, factor = ROWS[SEIZINGER], contact_settings(SEIZINGER)["roll_factor"]
    pairing = sand.Contact.like(SEIZINGER).pairing(PRESETS[SEIZINGER], PRESETS[SEIZINGER])
    from sand.contact.jkr import LAW
    from sand.contact.law import contact_constants

    c = contact_constants(LAW)(pairing, row.radius, row.radius, 1.0, 1.0)
    work = c.roll_stiffness * c.roll_limit * math.pi * c.reduced_radius
    assert row.roll_energy == pytest.approx(work, rel=1e-12, abs=0.0)
    assert row.roll_energy == pytest.approx(
        factor * contact(PRESETS[SEIZINGER], row.radius).roll_energy_clamped, rel=1e-12, abs=0.0
    )


def test_all_rows():
    """Every preset of a paper is a row, says what was read, and its settings are those of a contact model."""
    assert list(ROWS) == [paper.material.name for paper in PAPERS] == [name for name in PRESETS if name not in COMMON]
    for paper in PAPERS:
        assert paper.read and paper.source
        model = sand.Contact.like(paper.material.name)
        assert {key: getattr(model, key) for key in paper.contact} == paper.contact
        assert sand.Contact(**{key: getattr(sand.Contact(), key) for key in paper.contact}) == sand.Contact()


def test_python():
    """Presets are found in any case; arguments override them."""
    assert sand.Material.like("ICE (wada et al. 2013)") == PRESETS[WADA]
    mine = sand.Material.like(WADA, name="mine", density=900)
    assert (mine.name, mine.density, mine.surface_energy) == ("mine", 900.0, PRESETS[WADA].surface_energy)
    assert sand.Contact.like(SEIZINGER, slide_factor=1, damping="critical") == sand.Contact(
        roll_factor=8.0, slide_factor=1.0, damping="critical"
    )


def test_case_file():
    """`like` of materials and of contacts; keys beside it override, also with the value that is the default."""
    read = case(
        materials={"mine": {"like": SEIZINGER, "density": 2000.0}},
        forces={"contact": {"like": SEIZINGER, "slide_factor": 1.0}},
    )
    assert read.materials_by_name()["mine"] == PRESETS[SEIZINGER].but(name="mine", density=2000.0)
    assert read.forces.contact == sand.Contact(roll_factor=8.0, slide_factor=1.0)


@pytest.mark.parametrize(
    ("make", "lines"),
    [
        (
            lambda: sand.Material.like("ice (Wada 2013)"),
            ["unknown material 'ice (Wada 2013)'; did you mean 'ice (Wada et al. 2013)', 'ice (Wada et al. 2009)' or "
             "'ice (Wada et al. 2008)'?"],
        ),
        (
            lambda: sand.Contact.like("Seizinger 2012"),
            [f"there are no contact settings of 'Seizinger 2012'; did you mean '{SEIZINGER}'?"],
        ),
        (lambda: sand.Contact.like(3), ["preset = 3 must be text"]),
        (
            lambda: case(
                materials={"mine": {"like": "silica (Seizinger 2012)"}},
                forces={"contact": {"like": "silica (Seizinger 2012)"}},
            ),
            [
                f"case.toml: materials: mine.like: unknown material 'silica (Seizinger 2012)'; did you mean "
                f"'{SEIZINGER}'?",
                "case.toml: forces.contact.like: there are no contact settings of 'silica (Seizinger 2012)'; did you "
                f"mean '{SEIZINGER}'?",
            ],
        ),
        (
            lambda: case(materials={"mine": {"like": "ice"}}, forces={"contact": {"lik": "ice"}}),
            ["case.toml: forces.contact.lik: there is no such key; did you mean 'like'?"],
        ),
        (
            lambda: case(materials={"mine": {"like": "ice"}}, forces={"contact": {"like": 1}}),
            ["case.toml: forces.contact.like = 1 must be the name of a preset, as in docs: Materials"],
        ),
        (
            lambda: case(materials={"mine": {"like": "ice"}}, forces={"contact": {"like": WADA, "roll_factor": -1}}),
            ["case.toml: forces.contact: roll_factor = -1 must be at least 0"],
        ),
    ],
)  # fmt: skip
def test_messages(make, lines):
    """One line for each mistake, with the nearest names."""
    with pytest.raises(sand.BadInput) as caught:
        make()
    assert caught.value.problems == lines
