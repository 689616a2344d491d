"""External forces: formulas against their energies, B(t) at known times, settings and errors."""

import math
import tomllib

import numpy as np
import pytest
import tomli_w
from hypothesis import given
from hypothesis import strategies as st

import sand
from sand.basics.errors import BadInput
from sand.compiler.jit import kernel
from sand.config.case import check_case
from sand.forces import external_formulas as surroundings
from sand.forces.base import ExternalForce
from sand.forces.external_formulas import GrainState, field_in_time, flux_density_at, uniform_field
from tests.unit.pint_units import UNIT

EPS = np.finfo(float).eps
component = st.integers(-100, 100).map(lambda n: n / 100)
vector = st.tuples(component, component, component).filter(lambda v: np.linalg.norm(v) > 0.3)
MICRO = 1e-6  # the period of every oscillating field in this file [s]
SWING = sand.Field([0.1, 0.2, 0.3], shape="oscillating", amplitude=[1, 0, -2], frequency="1 MHz", phase="30 deg")
TURN = sand.Field([0.3, -0.1, 0.2], shape="rotating", amplitude=[1, -1, 0], frequency=1e6, axis=[1, 1, 1])
RAMP = sand.Field([0, 0, 1], shape="ramp", final=[2, 0, 1], start="1 us", end="3 us")
CONSTANT = sand.Field([0.3, -0.2, 0.9])
FIELDS = [CONSTANT, SWING, TURN, RAMP]
FORCES = [*FIELDS, sand.Gravity([1.0, -2.0, 3.0]), sand.ElectricField(["1 kV/m", 2.0, 3.0])]


def grain_state(position=(0.0, 0.0, 0.0), moment=(0.0, 0.0, 0.0), mass=1.0, charge=0.0):
    """A grain as formulas receive it."""
    return GrainState(tuple(position), (0.0,) * 3, (0.0,) * 3, tuple(moment), 1.0, mass, charge)


def b_at(field, time):
    """The flux density of a field, from the energies of three unit moments: −U = B·e."""
    return [-field.formula(time, grain_state(moment=e), field.numbers())[2] for e in np.eye(3)]


# --- formulas ---------------------------------------------------------------------------------------
@pytest.mark.parametrize("force", [sand.Gravity([1.5, -2.0, 3.0]), sand.ElectricField([1.5, -2.0, 3.0])])
@given(vector)
def test_force_is_minus_the_gradient_of_the_energy(force, position):
    """F = −∂U/∂x; U is linear, so central differences err by rounding only, ε |F| (|x| + h)/h with h = 1/2."""
    h, mass, charge = 0.5, 3.0, -7.0

    def loads(x):
        return force.formula(0.0, grain_state(x, mass=mass, charge=charge), force.numbers())

    slope = [(loads(position + h * e)[2] - loads(position - h * e)[2]) / (2 * h) for e in np.eye(3)]
    found, torque, _ = loads(position)
    size = np.linalg.norm(found)
    assert found == pytest.approx([-s for s in slope], abs=8 * EPS * size * (np.linalg.norm(position) + h) / h)
    assert torque == (0.0, 0.0, 0.0)


def test_gravity_and_electric_force_by_hand():
    """F = m g and q E, U = −F·x with 0 at the origin; a negative charge is pushed against E."""
    grain = grain_state((0.0, 0.0, 2.0), mass=3.0, charge=-5.0)
    down, up = sand.Gravity("9.81 m/s^2"), sand.ElectricField("2 V/m")
    force, _, energy = surroundings.uniform_gravity(0.0, grain, down.numbers())
    assert force == pytest.approx((0, 0, -3 * 9.81), rel=1e-6, abs=0.0)
    assert energy == pytest.approx(3 * 9.81 * 2, rel=1e-6, abs=0.0)  # above the origin: positive
    force, _, energy = surroundings.uniform_electric(0.0, grain, up.numbers())
    assert force == pytest.approx((0, 0, -10), rel=1e-6, abs=0.0)
    assert energy == pytest.approx(20, rel=1e-6, abs=0.0)
    for push in (down, up):
        assert push.formula(0.0, grain_state(mass=3.0, charge=-5.0), push.numbers())[2] == 0.0


def rotated(v, axis, angle):
    """v rotated about a unit vector, right-handed (Rodrigues)."""
    along = axis * (axis @ v)
    return along + (v - along) * math.cos(angle) + np.cross(axis, v) * math.sin(angle)


@pytest.mark.parametrize("field", FIELDS)
@given(vector, st.integers(0, 50).map(lambda n: n * 0.083e-6))
def test_torque_is_minus_the_gradient_of_the_energy(field, moment, time):
    """M = μ×B(t) = −∂U/∂θ for rotations of μ: truncation μB h²/6, rounding ε μB/h."""
    h, numbers = 1e-5, field.numbers()

    def energy(axis, angle):
        return field.formula(time, grain_state(moment=rotated(np.array(moment), axis, angle)), numbers)[2]

    slope = [(energy(e, h) - energy(e, -h)) / (2 * h) for e in np.eye(3)]
    force, torque, _ = field.formula(time, grain_state(moment=moment), numbers)
    size = np.linalg.norm(moment) * field.flux_density_size()
    assert torque == pytest.approx([-s for s in slope], abs=size * (h * h + 10 * EPS / h))
    assert torque == pytest.approx(np.cross(moment, b_at(field, time)), abs=10 * EPS * size)
    assert force == (0.0, 0.0, 0.0)


@pytest.mark.compiled("small")
@pytest.mark.parametrize("force", FORCES)
def test_compiled_formulas_equal_plain_python(force):
    """Force, torque and energy, to the rounding of sin and of short sums."""
    grain = grain_state((0.3, -2.0, 1.1), (0.5, 1.0, -0.4), mass=3.0, charge=-7.0)
    plain = force.formula(1.7e-6, grain, force.numbers())
    compiled = kernel(force.formula, cached=False)(1.7e-6, grain, force.numbers())
    size = max(np.abs(np.concatenate([*plain[:2], [plain[2]]])))
    for found, expected in zip(compiled, plain, strict=True):
        assert found == pytest.approx(expected, abs=100 * EPS * size)


# --- B(t) -------------------------------------------------------------------------------------------
def check_flux_density(field, parts, expected):
    """B at these fractions of the period, to the rounding of an angle of a few turns."""
    for part, b in zip(parts, expected, strict=True):
        assert b_at(field, part * MICRO) == pytest.approx(b, abs=100 * EPS * field.flux_density_size()), part


def test_oscillating_field():
    """B0 + B1 cos(2πft + φ) at quarters of the period."""
    b0, b1 = np.array([0.1, 0.2, 0.3]), np.array([1.0, 0.0, -2.0])
    swing = {"shape": "oscillating", "amplitude": b1, "frequency": "1 MHz"}
    check_flux_density(sand.Field(b0, **swing), (0, 0.25, 0.5, 0.75, 1), (b0 + b1, b0, b0 - b1, b0, b0 + b1))
    check_flux_density(sand.Field(b0, **swing, phase="90 deg"), (0, 0.25, 0.75), (b0, b0 - b1, b0 + b1))
    check_flux_density(sand.Field(b0, **swing, phase=math.pi), (0, 0.5), (b0 - b1, b0 + b1))
    check_flux_density(
        sand.Field(0, shape="oscillating", amplitude="1 mT", frequency=1e6), (1 / 3,), ([0, 0, -0.5e-3],)
    )


def test_rotating_field_is_right_handed():
    """About z: x → y → −x; about −z: x → −y; about (1,1,1) a third of a turn takes x to y, y to z, z to x."""
    turn = {"shape": "rotating", "frequency": "1 MHz"}
    about_z = sand.Field([0, 0, 0.5], amplitude=[2, 0, 0], axis=[0, 0, 7], **turn)
    check_flux_density(about_z, (0, 0.25, 0.5, 0.75), ([2, 0, 0.5], [0, 2, 0.5], [-2, 0, 0.5], [0, -2, 0.5]))
    back = sand.Field(0, amplitude=[2, 0, 0], axis=[0, 0, -1], **turn)
    check_flux_density(back, (0, 0.25), ([2, 0, 0], [0, -2, 0]))
    ahead = sand.Field(0, amplitude=[2, 0, 0], axis=[0, 0, 1], phase="90 deg", **turn)
    check_flux_density(ahead, (0, 0.25), ([0, 2, 0], [-2, 0, 0]))
    diagonal = sand.Field(0, amplitude=[1, -1, 0], axis=[1, 1, 1], **turn)
    check_flux_density(diagonal, (0, 1 / 3, 2 / 3), ([1, -1, 0], [0, 1, -1], [-1, 0, 1]))
    assert [np.linalg.norm(b_at(diagonal, t)) for t in (1e-7, 3e-7, 8e-7)] == pytest.approx(
        [math.sqrt(2)] * 3, rel=1e-6, abs=0.0
    )


def test_ramp_is_constant_before_and_after():
    """B0 up to the start, the mean in the middle, `final` from the end on; the default start is 0."""
    b0, b1 = np.array([0.0, 0.0, 1.0]), np.array([2.0, 0.0, 1.0])
    check_flux_density(RAMP, (-5, 0, 1, 2, 3, 1e6), (b0, b0, b0, (b0 + b1) / 2, b1, b1))
    check_flux_density(RAMP, (1.5,), (0.75 * b0 + 0.25 * b1,))
    from_zero = sand.Field(0, shape="ramp", final="1 mT", end="4 us")
    assert from_zero.start == 0.0
    check_flux_density(from_zero, (0, 1, 4, 5), ([0, 0, 0], [0, 0, 0.25e-3], [0, 0, 1e-3], [0, 0, 1e-3]))


@pytest.mark.parametrize(
    ("field", "slope"),
    [
        (SWING, lambda t: -2e6 * math.pi * math.sin(2e6 * math.pi * t + math.pi / 6) * np.array([1, 0, -2])),
        (TURN, lambda t: 2e6 * math.pi * np.cross(np.full(3, 3**-0.5), np.subtract(b_at(TURN, t), TURN.flux_density))),
        (RAMP, lambda t: np.array([1e6, 0.0, 0.0])),
        (CONSTANT, lambda t: np.zeros(3)),
    ],
)
def test_time_derivative_of_the_energy(field, slope):
    """∂U/∂t = −μ·dB/dt; dB/dt = Ω×B of a rotating field. Central differences: (ωh)²/6 = 7e-8 and ε/ωh."""
    moment, h, time = np.array([0.5, 1.0, -0.4]), 1e-10, 1.37e-6

    def energy(t):
        return field.formula(t, grain_state(moment=moment), field.numbers())[2]

    found = (energy(time + h) - energy(time - h)) / (2 * h)
    largest = np.linalg.norm(moment) * field.flux_density_size() * 2e6 * math.pi
    assert found == pytest.approx(-moment @ slope(time), abs=2e-7 * largest)


@pytest.mark.slow
@pytest.mark.parametrize("field", [*FIELDS, sand.Field("-2 mT"), sand.Field(3, shape="ramp", final=-1, end=3e-6)])
def test_flux_density_size_is_the_maximum(field):
    """max |B(t)| over 10000 times of four periods or the ramp; a step of 2.5e-3 rad misses it by 8e-7."""
    sizes = [np.linalg.norm(b_at(field, t)) for t in np.linspace(0.0, 4e-6, 10001)]
    bound = field.flux_density_size()
    assert max(sizes) <= bound * (1 + 10 * EPS)
    assert max(sizes) == pytest.approx(bound, rel=1e-6, abs=0.0)


# --- attributes of forces -----------------------------------------------------------------------------
def test_time_dependent_attribute():
    """It enables recorded work and limits the step; the constant field uses a cheaper formula."""
    assert [f.formula for f in FIELDS] == [uniform_field, field_in_time, field_in_time, field_in_time]
    assert [f.time_dependent for f in FIELDS] == [False, True, True, True]
    assert [f.longest_step() for f in FIELDS] == pytest.approx(
        [math.inf, MICRO / 200, MICRO / 200, 2e-8], rel=1e-6, abs=0.0
    )
    assert flux_density_at(0.0, RAMP.numbers()) == (0.0, 0.0, 1.0)


def test_position_dependent_attribute():
    """Energies of gravity and electric field depend on position; neither has a magnetic field."""
    for force in FORCES[-2:]:
        assert force.position_dependent
        assert not getattr(force, "time_dependent", False)
        assert force.flux_density_size() == 0.0
    assert not any(getattr(f, "position_dependent", False) for f in FIELDS)
    assert all(isinstance(f, ExternalForce) for f in FORCES)


def test_optional_members_of_external_forces():
    """`time_dependent`, `position_dependent` and `longest_step` may be missing."""
    asked = ("parameters", "check", "numbers", "flux_density_size")
    old = type("Old", (), {"name": "old", "references": "", "formula": None, **dict.fromkeys(asked, lambda self: 0)})
    assert isinstance(old(), ExternalForce)


def test_forces_that_act_on_no_grain_warn():
    """A field without moments, an electric field without charges."""
    grains = sand.Grains([[0, 0, 0]], 1e-8, "iron")
    magnetic = sand.Grains([[0, 0, 0]], 1e-8, "iron", moment=[[1e-18, 0, 0]])
    charged = sand.Grains([[0, 0, 0]], 1e-8, "iron", charge="-1.6e-19 C")
    box = sand.Box.open()
    for indifferent in (grains, magnetic):
        (text,) = sand.ElectricField(1.0).check(indifferent, box)
        assert text == "an electric field is switched on but no grain has a charge"
    for indifferent in (grains, charged):
        assert "no grain has a magnetic moment" in SWING.check(indifferent, box)[0]
    assert sand.ElectricField(1.0).check(charged, box) == SWING.check(magnetic, box) == []
    assert sand.Gravity(1.0).check(grains, box) == []


# --- settings ---------------------------------------------------------------------------------------
@pytest.mark.slow
def test_scalars_and_units():
    """A scalar is along +z, for gravity along −z; text and quantities have units."""
    assert sand.Gravity("9.81 m/s^2").acceleration == (0.0, 0.0, -9.81)
    assert sand.Gravity([0, "1 cm/s^2", 0]).acceleration == (0.0, 0.01, 0.0)
    assert str(sand.Gravity(0).acceleration) == "(0.0, 0.0, 0.0)"
    assert sand.ElectricField("1 kV/cm").strength == (0.0, 0.0, 1e5)
    assert (
        sand.Field(UNIT.Quantity(2.0, "mT")) == sand.Field(UNIT.Quantity([0.0, 0.0, 2.0], "mT")) == sand.Field("2 mT")
    )
    assert SWING.phase == pytest.approx(math.pi / 6, rel=1e-6, abs=0.0)
    assert (SWING.frequency, TURN.phase, RAMP.end) == (1e6, 0.0, 3e-6)


@pytest.mark.parametrize("force", [*FORCES, sand.Gravity("1 m/s^2"), sand.Field(0, shape="ramp", final=1, end=2)])
def test_case_file_round_trip(force):
    """Parameters to TOML and back: an equal object and equal numbers; also directly through the class."""
    case = {"run": {"steps": 1}, "grains": {"number": 1, "radius": 1e-8}, "forces": {force.name: force.parameters()}}
    read = check_case(tomllib.loads(tomli_w.dumps(case)), "some.toml").forces.build()
    assert read == [force] == [type(force)(**force.parameters())]
    assert read[0].numbers() == force.numbers()
    assert read[0].parameters() == force.parameters()


OSCILLATING = {"shape": "oscillating", "amplitude": "1 mT", "frequency": "1 MHz"}
ROTATING = {"shape": "rotating", "amplitude": ["1 mT", 0, 0], "frequency": "1 MHz", "axis": [0, 0, 1]}
RAMPING = {"shape": "ramp", "final": "1 mT", "end": "5 us"}


def test_the_amplitude_suggested_by_the_error_is_accepted():
    """Its component across an oblique axis, in nine digits; the rest along the axis is dropped."""
    oblique = {"shape": "rotating", "frequency": 1e6, "axis": [0.3, 0.5, 0.8]}
    with pytest.raises(BadInput, match="must be perpendicular") as caught:
        sand.Field(0, amplitude=["1 mT", 0, 0], **oblique)
    proposed = [float(part) for part in str(caught.value).rpartition("[")[2].partition("]")[0].split(",")]
    field = sand.Field(0, amplitude=proposed, **oblique)
    axis = np.array(oblique["axis"]) / np.linalg.norm(oblique["axis"])
    assert proposed == pytest.approx(1e-3 * (np.array([1, 0, 0]) - axis[0] * axis), abs=1e-11)
    for time in (0.0, 0.3e-6):
        assert axis @ b_at(field, time) == pytest.approx(0.0, abs=10 * EPS * 1e-3)


def test_all_wrong_settings_are_reported_together():
    """Of one class, and of a case file, whose lines begin with the key."""
    field = {"flux_density": [0, "1 m", math.nan], "shape": "rotating", "frequency": -1, "axis": [0, 0, 0], "final": 1}
    with pytest.raises(BadInput) as caught:
        sand.Field(**field)
    keys = ["flux_density y", "flux_density z", "amplitude is missing", "frequency", "axis", "final"]
    assert [sum(f"field: {key}" in line for line in caught.value.problems) for key in keys] == [1] * 6
    assert len(caught.value.problems) == 6
    forces = {"field": field, "gravity": {"acceleration": ["1 m", 0, "2 m"]}, "electric": {"strenght": 1}}
    case = {"run": {"steps": 1}, "grains": {"number": 1, "radius": 1e-8}, "forces": forces}
    with pytest.raises(BadInput) as caught:
        check_case(case, "some.toml")
    lines = caught.value.problems
    assert sum(line.startswith("some.toml: forces.field: ") for line in lines) == 6
    assert sum(line.startswith("some.toml: forces.gravity: acceleration ") for line in lines) == 2
    assert any("forces.electric.strenght" in line and "did you mean 'strength'?" in line for line in lines)
    assert any("forces.electric.strength is missing" in line for line in lines)
    assert len(lines) == 10
