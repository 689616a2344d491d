"""Wrong settings: one table of what is given and the lines that it gives.  Nothing is compiled."""

import math

import pytest

import sand
from sand.basics.errors import BadInput
from sand.setup import GrainClass

OSCILLATING = {"shape": "oscillating", "amplitude": "1 mT", "frequency": "1 MHz"}
ROTATING = {"shape": "rotating", "amplitude": ["1 mT", 0, 0], "frequency": "1 MHz", "axis": [0, 0, 1]}
RAMPING = {"shape": "ramp", "final": "1 mT", "end": "5 us"}
CRITICAL, EWALD = {"damping": "critical"}, {"periodic": "ewald"}
NAN, INF = math.nan, math.inf

RIGHT = {
    sand.Gas: {"temperature": "100 K", "pressure": "1 Pa"},
    sand.Field: {"flux_density": "1 mT"},
    sand.Wall: {"point": [0, 0, 0], "normal": [0, 0, 1], "material": "silica"},
    sand.Driven: {"grains": [0]},
    sand.Material: {
        "name": "dust",
        "density": 1000.0,
        "surface_energy": 0.1,
        "young_modulus": 1e10,
        "poisson_ratio": 0.2,
    },
    GrainClass: {"share": 1.0},
}
"""Arguments that are given besides those of the table."""

TABLE = {
    sand.Material: [
        ({"density": "1 kg"}, ["dust: density = '1 kg' is not a quantity in kg/m^3"]),
        ({"poisson_ratio": 0.6}, ["dust: poisson_ratio = 0.6 must be above -1 and at most 0.5"]),
        (
            {"anisotropy": -1.0},
            ["dust: anisotropy = -1 must be above 0 J/m^3 if it is uniaxial; K1 of a cubic crystal"],
        ),
        ({"anisotropy": 0.0, "anisotropy_kind": "cubic"}, ["dust: anisotropy = 0 must not be 0 J/m^3 if it is cubic"]),
        ({"anisotropy_kind": "cubical"}, ["dust: anisotropy_kind = 'cubical'; did you mean 'cubic'"]),
        (
            {"anisotropy": "1 J"},
            ["dust: anisotropy = '1 J' is not a quantity in J/m^3; give a number in SI or text such"],
        ),
        ({"exchange_stiffness": NAN}, ["dust: exchange_stiffness = nan is not finite"]),
    ],
    sand.Contact: [
        ({"slip": "clmp"}, ["contact: slip = 'clmp'; did you mean 'clamp'?"]),
        ({"slip": None}, ["contact: slip = None; allowed: clamp, reset"]),
        ({"stiffness": "frozn"}, ["contact: stiffness = 'frozn'; did you mean 'frozen'"]),
        ({"damping": "viscous"}, ["contact: damping = 'viscous'; did you mean 'viscoelastic'"]),
        ({"mixing": "mean"}, ["contact: mixing = 'mean'; allowed: geometric"]),
        ({"roll_factor": -1}, ["contact: roll_factor = -1 must be at least 0"]),
        ({"rolling_limit": "1 kg"}, ["contact: rolling_limit = '1 kg' is not a quantity in m"]),
        (
            {"damping": "constant"},
            ["contact: damping_constant is missing: damping = 'constant' needs a number in kg/s"],
        ),
        ({"damping": "viscoelastic"}, ["contact: viscous_time is missing: damping = 'viscoelastic' needs a time in s"]),
        (CRITICAL | {"damping_ratio": -0.1}, ["contact: damping_ratio = -0.1 must be above 0 and at most 5"]),
        (CRITICAL | {"damping_ratio": 5.1}, ["contact: damping_ratio = 5.1 must be above 0 and at most 5"]),
        (
            {"damping_ratio": 0.2},
            ["contact: damping_ratio = 0.2 is not used by damping = 'none'; leave it out, or give"],
        ),
        (CRITICAL | {"viscous_time": "1 ps"}, ["contact: viscous_time = '1 ps' is not used by damping = 'critical'"]),
        ({"damping_constant": "1 m"}, ["contact: damping_constant = '1 m' is not used by damping = 'none'"]),
        (
            {"damping": "constant", "damping_constant": "1 m"},
            ["contact: damping_constant = '1 m' is not a quantity in kg/s"],
        ),
        ({"bath_temperature": "100 K"}, ["contact: bath_temperature needs damping"]),
        (CRITICAL | {"bath_temperature": "0 K"}, ["contact: bath_temperature = '0 K' must be above 0 K"]),
        ({"settling_time": 0.0}, ["contact: settling_time = 0.0 must be above 0 s"]),
        ({"settling_time": "5 nm"}, ["contact: settling_time = '5 nm' is not a quantity in s"]),
        (
            {"damping_constant": -1.0, "stiffness": "x", "viscous_time": "1 m"},
            ["contact: stiffness", "contact: damping_constant", "contact: viscous_time"],
        ),
    ],
    sand.Field: [
        ({"shape": "rotatin"}, ["field: shape = 'rotatin'; did you mean 'rotating'?"]),
        ({"shape": "square"}, ["field: shape = 'square'; allowed: constant, oscillating, rotating, ramp"]),
        (
            {"frequency": "1 MHz"},
            [
                "field: frequency = '1 MHz' is not used by shape = 'constant'; leave it out, or give shape = "
                "'oscillating' or 'rotating'"
            ],
        ),
        (
            RAMPING | {"axis": [0, 0, 1]},
            ["field: axis = [0, 0, 1] is not used by shape = 'ramp'; leave it out, or give shape = 'rotating'"],
        ),
        (OSCILLATING | {"end": "1 K"}, ["field: end = '1 K' is not used by shape = 'oscillating'"]),
        (
            OSCILLATING | {"amplitude": None},
            [
                "field: amplitude is missing: shape = 'oscillating' needs one value along z or three components, in T, "
                "such as '1 mT'"
            ],
        ),
        (
            OSCILLATING | {"frequency": None},
            [
                "field: frequency is missing: shape = 'oscillating' needs oscillations or rotations per second, in Hz, "
                "such as '1 MHz'"
            ],
        ),
        (
            ROTATING | {"axis": None},
            ["field: axis is missing: shape = 'rotating' needs three numbers, such as [0, 0, 1]"],
        ),
        (RAMPING | {"final": None}, ["field: final is missing: shape = 'ramp' needs one value along z or three comp"]),
        (RAMPING | {"end": None}, ["field: end is missing: shape = 'ramp' needs a time in s, such as '5 us'"]),
        ({"flux_density": None}, ["field: flux_density z = None is not a quantity in T"]),
        (
            {"flux_density": [1, 2]},
            ["field: flux_density = [1, 2] must be one value along z or three components, in T"],
        ),
        ({"flux_density": "1 m"}, ["field: flux_density z = '1 m' is not a quantity in T"]),
        ({"flux_density": [0, "nan T", 0]}, ["field: flux_density y = 'nan T' is not finite; give a number in T"]),
        (OSCILLATING | {"amplitude": [1, 2]}, ["field: amplitude = [1, 2] must be one value along z or three comp"]),
        (OSCILLATING | {"amplitude": "1 A"}, ["field: amplitude z = '1 A' is not a quantity in T; give"]),
        (OSCILLATING | {"frequency": "-1 Hz"}, ["field: frequency = '-1 Hz' must be above 0 Hz"]),
        (OSCILLATING | {"frequency": 0}, ["field: frequency = 0 must be above 0 Hz"]),
        (OSCILLATING | {"frequency": NAN}, ["field: frequency = nan is not finite; give a number in Hz"]),
        (
            OSCILLATING | {"frequency": "6.28 rad/s"},
            ["field: frequency = '6.28 rad/s' has a unit of angle; give oscillations or rotations per second"],
        ),
        (OSCILLATING | {"frequency": "60 rpm"}, ["field: frequency = '60 rpm' has a unit of angle; give oscillations"]),
        (OSCILLATING | {"phase": INF}, ["field: phase = inf is not finite; give a number in rad"]),
        (OSCILLATING | {"phase": "1 m"}, ["field: phase = '1 m' is not a quantity in rad"]),
        (RAMPING | {"start": "1 m"}, ["field: start = '1 m' is not a quantity in s"]),
        (ROTATING | {"axis": [0, 0, 0]}, ["field: axis = [0, 0, 0] has no direction; give three numbers, not all 0"]),
        (ROTATING | {"axis": "z"}, ["field: axis = 'z' must be three numbers, such as [0, 0, 1]"]),
        (ROTATING | {"axis": [0, 0, NAN]}, ["field: axis z = nan is not finite"]),
        (
            ROTATING | {"amplitude": "1 mT"},
            [
                "field: amplitude = [0.0, 0.0, 0.001] must be perpendicular to axis = [0.0, 0.0, 1.0]; its component "
                "perpendicular to the axis is [0, 0, 0] T"
            ],
        ),
        (
            ROTATING | {"amplitude": [3, 0, 3], "axis": [1, 0, 0]},
            [
                "field: amplitude = [3.0, 0.0, 3.0] must be perpendicular to axis = [1.0, 0.0, 0.0]; its component "
                "perpendicular to the axis is [0, 0, 3] T"
            ],
        ),
        (RAMPING | {"start": "5 us"}, ["field: end = 5e-06 must be after start = 5e-06, in s"]),
        (RAMPING | {"end": -1}, ["field: end = -1.0 must be after start = 0.0, in s"]),
    ],
    sand.Gravity: [
        ({"acceleration": [0, 1]}, ["gravity: acceleration = [0, 1] must be one value along −z or three components"]),
        ({"acceleration": "9.81 m"}, ["gravity: acceleration z = '9.81 m' is not a quantity in m/s^2"]),
        (
            {"acceleration": -9.81},
            [
                "gravity: acceleration = -9.81 is a magnitude along −z and must be at least 0 m/s^2; for another "
                "direction give three components"
            ],
        ),
        ({"acceleration": NAN}, ["gravity: acceleration z = nan is not finite"]),
    ],
    sand.ElectricField: [
        ({"strength": "1 V"}, ["electric: strength z = '1 V' is not a quantity in V/m"]),
        ({"strength": [0, INF, 0]}, ["electric: strength y = inf is not finite; give a number in V/m"]),
    ],
    sand.Gas: [
        ({"temperature": -1}, ["gas: temperature = -1 must be above 0 K"]),
        ({"temperature": NAN}, ["gas: temperature = nan is not finite; give a number in K"]),
        ({"temperature": "20 m"}, ["gas: temperature = '20 m' is not a quantity in K"]),
        ({"density": 1.0}, ["gas: give either the density in kg/m^3 or the pressure in Pa; both"]),
        ({"pressure": None}, ["gas: give either the density in kg/m^3 or the pressure in Pa; neither is given"]),
        ({"pressure": 0}, ["gas: pressure = 0 must be above 0 Pa"]),
        ({"pressure": None, "density": -2.0}, ["gas: density = -2.0 must be above 0 kg/m^3"]),
        ({"molecule_mass": "0 kg"}, ["gas: molecule_mass = '0 kg' must be above 0 kg"]),
        ({"accommodation": 1.5}, ["gas: accommodation = 1.5 must be at least 0 and at most 1"]),
        ({"accommodation": -0.1}, ["gas: accommodation = -0.1 must be at least 0 and at most 1"]),
        ({"accommodation": "much"}, ["gas: accommodation = 'much' is not a number"]),
        ({"brownian": "no"}, ["gas: brownian = 'no' must be true or false"]),
        ({"wind": 3.0}, ["gas: wind = 3.0 must be three components, in m/s"]),
        ({"wind": [1, INF, 0]}, ["gas: wind y = inf is not finite; give a number in m/s"]),
        ({"cross_section": "1 nm"}, ["gas: cross_section = '1 nm' is not a quantity in m^2"]),
    ],
    sand.Dipoles: [
        ({"cutoff": "3 K"}, ["dipoles: cutoff = '3 K' is not a quantity in m"]),
        ({"cutoff": -1.0}, ["dipoles: cutoff = -1.0 must be above 0 m"]),
        ({"periodic": "evald"}, ["dipoles: periodic = 'evald'; did you mean 'ewald'"]),
        (EWALD | {"boundary": "air"}, ["dipoles: boundary = 'air'; allowed: tin-foil, vacuum"]),
        (EWALD | {"accuracy": 1e-9}, ["dipoles: accuracy = 1e-09 must be at least 1e-08 and at most 0.1"]),
        (EWALD | {"accuracy": 0.2}, ["dipoles: accuracy = 0.2 must be at least 1e-08 and at most 0.1"]),
        (EWALD | {"cutoff": "0.1 um"}, ["dipoles: cutoff = 1e-07 cannot be given with periodic = 'ewald'"]),
        (EWALD | {"cutoff": None}, ["dipoles: cutoff = None cannot be given with periodic"]),
        (EWALD | {"cut": "sharp"}, ["dipoles: cut = 'sharp' cannot be given with periodic"]),
        ({"accuracy": 1e-4}, ["dipoles: accuracy is used only with periodic = 'ewald'"]),
        (
            EWALD | {"open": "pairs"},
            ["dipoles: open = 'pairs' is for open boxes and periodic = 'ewald' for periodic ones"],
        ),
        (
            EWALD
            | {"cutoff": "1 um", "cut": "sharp", "open": "tree", "accuracy": 0.2, "boundary": "foil"}
            | {"reciprocal": "meshes"},
            [
                "dipoles: accuracy = 0.2 must be at least 1e-08 and at most 0.1",
                "dipoles: boundary = 'foil'; did you mean",
                "dipoles: reciprocal = 'meshes'; did you mean 'mesh'?",
                "dipoles: cutoff = 1e-06 cannot be given with periodic = 'ewald'",
                "dipoles: cut = 'sharp' cannot be given with periodic = 'ewald'",
                "dipoles: open = 'tree' is for open boxes and periodic = 'ewald' for periodic ones; leave one of",
            ],
        ),
        ({"open": "octree"}, ["dipoles: open = 'octree'; did you mean 'tree'"]),
        (
            {"open": "pairs", "accuracy": 1e-2},
            ["dipoles: accuracy is used only with periodic = 'ewald' or open = 'tree'"],
        ),
        ({"open": "tree", "accuracy": 0.2}, ["dipoles: accuracy = 0.2 must be at least 1e-08 and at most 0.1"]),
        (
            {"open": "tree", "periodic": "ewald", "cutoff": "1 um"},
            [
                "dipoles: cutoff = 1e-06 cannot be given with periodic",
                "dipoles: open = 'tree' is for open boxes and periodic = 'ewald'",
            ],
        ),
        (
            {"open": "tree", "accuracy": 1e-7, "cutoff": "1 um", "cut": "sharp", "boundary": "vacuum"},
            [
                "dipoles: accuracy = 1e-07 must be at least 1e-06 with open = 'tree'",
                "dipoles: boundary is used only with periodic = 'ewald'; add that, or leave it out",
                "dipoles: cutoff = 1e-06 cannot be given with open = 'tree', which sums all pairs",
                "dipoles: cut = 'sharp' cannot be given with open = 'tree'",
            ],
        ),
        (
            {"open": "pairs", "cutoff": "1 um"},
            ["dipoles: cutoff = 1e-06 cannot be given with open = 'pairs', which sums all"],
        ),
        (
            {"open": "tree", "accuracy": 1e-3, "reciprocal": "mesh"},
            ["dipoles: reciprocal is used only with periodic = 'ewald'"],
        ),
    ],
    sand.Charges: [
        ({"periodic": "evald"}, ["charges: periodic = 'evald'; did you mean 'ewald'"]),
        (
            EWALD | {"cut": "sharp", "cutoff": "0.1 um", "accuracy": 2, "boundary": "vacuum"},
            [
                "charges: accuracy = 2 must be at least 1e-08 and at most 0.1",
                "charges: cutoff = 1e-07 cannot be given with periodic = 'ewald'",
                "charges: cut = 'sharp' cannot be given with periodic = 'ewald'",
                "charges: boundary = 'vacuum' is for dipoles only",
            ],
        ),
        (
            {"periodic": "nearest image", "accuracy": 1e-4},
            ["charges: accuracy is used only with periodic = 'ewald'"],
        ),
        (
            {"cut": "sharp", "accuracy": 1e-4},
            ["charges: accuracy is used only by an Ewald sum, which has no cut; leave it out"],
        ),
        ({"boundary": "vacuum"}, ["charges: boundary = 'vacuum' is for dipoles only"]),
    ],
    sand.Attraction: [
        ({"periodic": "ewald"}, ["Attraction: there is no argument 'periodic'; allowed: cutoff, cut"]),
    ],
    sand.ScreenedCharges: [
        ({}, ["ScreenedCharges: screening_length is missing"]),
        ({"screening_length": "-1 nm"}, ["screened_charges: screening_length = '-1 nm' must be above 0 m"]),
        ({"screening_length": 1e-7, "cut": "sharpe"}, ["screened_charges: cut = 'sharpe'; did you mean 'sharp'"]),
        (
            {"screening_length": 1e-7, "periodic": "ewald"},
            ["ScreenedCharges: there is no argument 'periodic'; allowed: screening_length, cutoff, cut"],
        ),
    ],
    sand.Verlet: [
        ({"steps_per_period": 2}, ["stepping: steps_per_period = 2 must be at least 10"]),
        ({"step": "1 m"}, ["stepping: step = '1 m' is not a quantity in s"]),
        ({"accuracy": 2.0}, ["stepping: accuracy = 2.0 must be above 0 and below 1"]),
        ({"far": "tailor"}, ["stepping: far = 'tailor'; did you mean 'taylor'?"]),
        ({"far_steps": 0}, ['stepping: far_steps = 0 must be a whole number of at least 1, or "auto"']),
        (
            {"far_steps": 10**30},
            ["stepping: far_steps = 1000000000000000000000000000000 must be a whole number from 1"],
        ),
    ],
    sand.RigidClusters: [
        ({"vibration": 0.2}, ["stepping: vibration = 0.2 must be above 0 and at most 0.1"]),
        ({"vibration": 0.0}, ["stepping: vibration = 0.0 must be above 0 and at most 0.1"]),
        ({"step_fraction": 1.0}, ["stepping: step_fraction = 1.0 must be above 0 and at most 0.2"]),
        ({"longest_step": "1 m"}, ["stepping: longest_step = '1 m' is not a quantity in s"]),
        ({"contact_stepping": "verlet"}, ["stepping: contact_stepping = 'verlet'; give sand.Verlet(…)"]),
        (
            {"contact_stepping": sand.Verlet(far="taylor")},
            ["stepping: far = 'taylor' is not possible with rigid clusters; use 'impulse' or 'every step'"],
        ),
    ],
    sand.Neighbours: [
        ({"search": "cell"}, ["neighbours: search = 'cell'; did you mean 'cells'?"]),
        ({"margin": 0.0}, ["neighbours: margin = 0.0 must be above 0 m"]),
    ],
    sand.Wall: [
        (
            {"point": [0, 0, "1 s"], "normal": [0, 0, 0], "material": "silka", "mass": -1, "name": "a-b"},
            [
                "wall: point z = '1 s' is not a quantity in m",
                "wall: normal = [0, 0, 0] has no direction; give that from the wall to the grains",
                "unknown material 'silka'; did you mean 'silica'?",
                "wall: mass = -1 must be above 0 kg",
                "wall: name = 'a-b' must be made of letters, digits and '_', such as 'left'",
            ],
        ),
        ({"force": "1 nN"}, ["wall: force is given without a mass; give the mass of the wall, such as '1e-15 kg'"]),
    ],
    sand.Driven: [
        ({"grains": []}, ["driven: grains = [] is empty; give indices of grains, such as [0, 1]"]),
        (
            {"grains": [-1], "velocity": [1, 2], "spin": [0, 0, "1 m"]},
            [
                "driven: grains[0] = -1 must be a whole number of at least 0",
                "driven: velocity = [1, 2] must be three components, in m/s",
                "driven: spin z = '1 m' is not a quantity in rad/s",
            ],
        ),
    ],
    GrainClass: [
        ({"share": None}, ["give either share, a fraction such as 0.5, or number"]),
        ({"share": 1.5}, ["share = 1.5 must be above 0 and at most 1"]),
        ({"kind": "bpc"}, ["kind = 'bpc'; did you mean"]),
        ({"kind": "bpca"}, ["grains is missing: how many does the bpca have?"]),
        ({"kind": "file"}, ["file is missing: kind = 'file' needs a file that holds the aggregate"]),
        ({"grains": 4}, ["grains = 4 is not used by kind = 'grain'; leave it out, or change kind"]),
        ({"file": "a.xyz"}, ["file = 'a.xyz' is not used by kind = 'grain'; leave it out, or give kind = 'file'"]),
    ],
}
ROWS = [(kind, given, lines) for kind, rows in TABLE.items() for given, lines in rows]


@pytest.mark.parametrize(("kind", "given", "lines"), ROWS, ids=[f"{k.__name__}-{given}"[:60] for k, given, _ in ROWS])
def test_a_wrong_setting_gives_its_lines(kind, given, lines):
    """One line for each mistake, in the order of the fields: what, where, unit, what is allowed, what to do."""
    with pytest.raises(BadInput) as caught:
        kind(**RIGHT.get(kind, {}) | given)
    assert len(caught.value.problems) == len(lines), caught.value.problems
    for line, found in zip(lines, caught.value.problems, strict=True):
        assert found.startswith(line)
        assert "\n" not in found
