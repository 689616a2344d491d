"""Forces of the user: decorators, messages for mistakes, case files, and resumption by import path."""

import importlib
import math
import sys

import numpy as np
import pytest

import sand
from sand.basics.errors import BadInput
from sand.cli.main import main
from sand.cli.report import resume_line
from sand.config.case import ForcesSection
from sand.forces.own import IMPORTED, OWN
from sand.forces.registry import FORCES

SCRIPT = """import sand

@sand.external_force(acceleration="m/s^2")
def lift(grain, p):
    g = p.acceleration
    return (0.0, 0.0, grain.mass * g), -grain.mass * g * grain.position[2]

@sand.pair_force(strength="N")
def pull(apart, a, b, p):
    x, y, z = apart
    r = (x * x + y * y + z * z) ** 0.5
    return (-p.strength * x / r, -p.strength * y / r, -p.strength * z / r), p.strength * r
"""


@pytest.fixture
def script(tmp_path, monkeypatch):
    """A module `own_script` with two forces, imported; forgotten afterwards."""
    (tmp_path / "own_script.py").write_text(SCRIPT)
    monkeypatch.syspath_prepend(tmp_path)
    importlib.invalidate_caches()
    yield importlib.import_module("own_script")
    forget()


def forget():
    """As in a new process: nothing of the script is known."""
    sys.modules.pop("own_script", None)
    for path in [path for path in OWN if path.startswith("own_script:")]:
        del OWN[path]


def grains():
    return sand.Grains([[0, 0, 0], [3e-7, 0, 0]], 1e-8, sand.SILICA, charge=1e-19)


def line_of(make):
    with pytest.raises(BadInput) as error:
        make()
    assert "\n" not in str(error.value)
    return str(error.value)


def test_formulas_with_and_without_time_parameters_and_torque():
    """All forms of an external formula give the loops force, torque and energy as floats."""

    @sand.external_force
    def constant(grain):
        return (1, 2, 3), 4

    @sand.external_force(k="1")
    def growing(time, grain, p):
        return (p.k * time, 0.0, 0.0), (0.0, p.k, 0.0), -p.k * time * grain.position[0]

    @sand.external_force("other_name", direction="1")
    def named(grain, p):
        return p.direction, 0.0

    assert constant().formula(0.0, None, ()) == ((1.0, 2.0, 3.0), (0.0, 0.0, 0.0), 4.0)
    assert not constant().time_dependent and growing(k=2).time_dependent
    force = growing(k=2.0)
    one = grains().position[1]
    from sand.forces.own import SAMPLE

    found = force.formula(3.0, SAMPLE._replace(position=tuple(one)), force.numbers())
    assert found == ((6.0, 0.0, 0.0), (0.0, 2.0, 0.0), -6.0 * one[0])
    aim = named(direction=[1, 2, 3])
    assert aim.name == "other_name" and aim.parameters()["direction"] == [1.0, 2.0, 3.0]


def test_case_files_name_a_force_by_its_import_path(script):
    """The table has import path and SI values; the force that it makes is the same, in the order of the file."""
    pull, lift = script.pull(strength="1 pN", cutoff="0.5 um"), script.lift(acceleration="2 m/s^2")
    assert pull.parameters() == {"import": "own_script:pull", "strength": 1e-12, "cutoff": 5e-7, "cut": "smooth"}
    tables = {force.name: force.parameters() for force in (pull, sand.Gravity(9.81), lift)}
    again = ForcesSection.model_validate(tables).build()
    assert [force.parameters() for force in again] == list(tables.values())
    assert [force.name for force in again] == ["pull", "gravity", "lift"]


def test_nothing_is_imported_without_being_asked(script, tmp_path):
    """A case file is read without the module; only its forces cannot be made, and the message says what to add."""
    table = script.lift(acceleration=1.0).parameters()
    forget()
    section = ForcesSection.model_validate({"lift": table})
    message = line_of(section.build)
    assert message.startswith("forces.lift: import = 'own_script:lift': SAND imports no modules on its own")
    assert "add --import own_script" in message and 'imports=["own_script"]' in message
    assert "own_script" not in sys.modules
    (tmp_path / "case.toml").write_text('[forces.lift]\nimport = "own_script:lift"\nacceleration = 1.0\n')
    assert resume_line(tmp_path).endswith(" --import own_script")
    assert "must be the place of a force" in line_of(ForcesSection.model_validate({"a": {"import": 3}}).build)
    assert "module math has no force 'sin'" in line_of(
        ForcesSection.model_validate({"a": {"import": "math:sin"}}).build
    )
    assert line_of(lambda: sand.resume(tmp_path, imports=["no_such_module"])).startswith("--import no_such_module:")


@pytest.mark.parametrize("command", ["run", "info", "grow", "collide"])
def test_commands_import_modules_on_request(script, tmp_path, monkeypatch, capsys, command):
    """`--import FILE` of every command that reads forces makes a force of the case known; without it a line says so."""
    forget()
    IMPORTED.clear()
    grains = "[grains]\nnumber = 2\nradius = '10 nm'\n[box]\nperiodic = '1 um'\n[run]\nuntil = '0.1 ns'\n"
    body = "kind = 'grain'\nradius = '10 nm'\n"
    bodies = f"[target]\n{body}[projectile]\n{body}[impact]\nspeed = '1 m/s'\n"
    table = "[forces.lift]\nimport = 'own_script:lift'\nacceleration = 1.0\n"
    case, out = tmp_path / "a.toml", [] if command == "info" else ["--out", str(tmp_path / "out")]
    case.write_text((bodies if command == "collide" else grains) + table)
    assert main([command, str(case), *out]) == 2
    assert "SAND imports no modules on its own; add --import own_script" in capsys.readouterr().err
    monkeypatch.setattr("sand.config.case.own_force", stopped)  # which would compile the force
    with pytest.raises(Stopped):
        main([command, str(case), *out, "--import", script.__file__, "--debug"])
    assert "own_script:lift" in OWN
    assert [script.__file__] == IMPORTED


class Stopped(Exception):
    """Raised when the force of the user is made."""


def stopped(*_, **__):
    raise Stopped


def test_the_energies_of_own_forces(script):
    """Forces, ledger columns and energies of grains, by the formulas; the pair's energy is shared in halves."""
    g = grains()
    pull, lift = script.pull(strength=1e-12), script.lift(acceleration=2.0)
    assert pull.energy_scale(g) == pytest.approx(1e-12 * 2e-8, rel=1e-12, abs=0.0)
    f, energy = pull.formula((0.0, 3e-7, 4e-7), None, None, pull.numbers(g, sand.Box.open()).own)
    assert f == pytest.approx((0.0, -0.6e-12, -0.8e-12), rel=1e-6, abs=0.0) and energy == pytest.approx(
        5e-19, rel=1e-6, abs=0.0
    )
    assert lift.flux_density_size() == 0.0 and lift.position_dependent


@pytest.mark.validate
def test_a_run_is_resumed_bit_by_bit(script, tmp_path):
    """A run in two pieces, the second one by `sand.resume(imports=…)`, equals a run in one; the ledger closes."""

    def begin(out):
        forces = [script.pull(strength="0.1 fN", cutoff="0.5 um"), script.lift(acceleration="1 km/s^2"), sand.Contact()]
        return sand.Simulation(grains(), forces, box="1.2 um", out=out, stepping=sand.Verlet(step="10 ns"))

    whole, part = begin(None), begin(tmp_path / "run")
    part.run(steps=150, until="1 s")
    assert part.at_grains()["pull"] == pytest.approx([0.5 * part.ledger["pull"][-1]] * 2, rel=1e-12, abs=0.0)
    assert whole.loads()["energy"]["pull"] == pytest.approx(1e-16 * 3e-7, rel=1e-12, abs=0.0)
    forget()
    assert "add --import own_script" in line_of(lambda: sand.resume(tmp_path / "run"))
    rest = sand.resume(tmp_path / "run", imports=["own_script"])
    rest.run(steps=150)
    whole.run(steps=300)
    assert rest.grains.position.tobytes() == whole.grains.position.tobytes()
    assert abs(np.ptp(rest.ledger["total"])) < 1e-6 * np.abs(rest.ledger["pull"]).max()


def helper(x):
    """Not decorated: numba refuses it."""
    return {1: x}[1]


@pytest.mark.parametrize(
    ("formula", "message"),
    [
        (lambda grain: ((1.0, 2.0), 0.5), "the force is (1.0, 2.0); it must be a tuple of three numbers"),
        (lambda grain: (np.zeros(3), 0.5), "it must be a tuple of three numbers"),
        (lambda grain: 1.0, "the formula returns a float; it must return force, energy or force, torque, energy"),
        (lambda grain: (1.0,), "the formula returns 1 values; it must return"),
        (lambda grain: ((1.0, 2.0, 3.0), "0"), "the energy, the last value, is '0'; it must be a number"),
        (
            lambda grain: ((grain.mas, 0.0, 0.0), 0.0),
            "fails for a test grain: AttributeError: 'GrainState' object",
        ),
        (lambda grain: ((math.log(-1.0), 0.0, 0.0), 0.0), "fails for a test grain: ValueError: "),
        (lambda: ((0.0, 0.0, 0.0), 0.0), "the formula takes 0 arguments; it must be own(grain) or own(time, grain)"),
    ],
)
def test_mistakes_in_a_formula(formula, message):
    """One line each, with the force, its file and line, and what is missing."""
    found = line_of(lambda: sand.external_force("own")(formula)())
    assert found.startswith(f"force 'own' (test_own_forces.py:{formula.__code__.co_firstlineno}): ")
    assert message in found


@pytest.mark.compiled("small")
def test_a_formula_that_numba_cannot_compile():
    """The message of the compiler is one line, with the line of the file."""

    @sand.external_force
    def own(grain):
        return (helper(1.0), 0.0, 0.0), 0.0

    found = line_of(lambda: sand.Simulation(grains(), [own()]))
    assert found.startswith("force 'own' (test_own_forces.py:")
    assert "numba cannot compile the formula: Untyped global name 'helper'" in found
    assert "functions that it calls need the decorator numba.njit" in found
    total = sand.external_force("total")(lambda grain: ((0.0, 0.0, 0.0), 0.0))
    assert "'total' is a column of the ledger" in line_of(lambda: sand.Simulation(grains(), [total()]))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: sand.external_force("gravity")(lambda grain: 0), "SAND has a force or ledger column of this name"),
        (lambda: sand.pair_force("coulomb")(lambda apart, a, b: 0), "SAND has a force or ledger column of this name"),
        (lambda: sand.pair_force("a b")(lambda apart, a, b: 0), "the name must be a word"),
        (lambda: sand.pair_force("own", cut="m")(lambda apart, a, b, p: 0), "a parameter cannot be called 'cut'"),
        (lambda: sand.pair_force("own", k=3)(lambda apart, a, b, p: 0), "k = 3 must be the unit of this parameter"),
        (lambda: sand.pair_force("own")(lambda apart, a: 0), "takes 2 arguments; it must be own(apart, a, b)"),
    ],
)
def test_names_that_are_refused(make, message):
    """Names of other forces and columns, and of keys that every table has."""
    assert message in line_of(make)
    assert "own" not in FORCES


def test_parameters_are_checked(script):
    """Unknown, missing and wrong values: a line each."""
    with pytest.raises(BadInput) as error:
        script.lift(accelaration=1.0)
    unknown, missing = str(error.value).splitlines()
    assert unknown == "lift: there is no parameter 'accelaration'; did you mean 'acceleration'?"
    assert missing == "lift: acceleration is missing; add acceleration=… in m/s^2"
    assert "lift: acceleration = '1 m'" in line_of(lambda: script.lift(acceleration="1 m"))
    assert "pull: cut = 'hard'" in line_of(lambda: script.pull(strength=1.0, cut="hard"))
    assert "is not a force" in line_of(lambda: sand.Simulation(grains(), [script.lift]))
