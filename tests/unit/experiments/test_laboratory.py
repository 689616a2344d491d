"""Packings that are compressed, stretched and sheared: start, rates, table, figure and jobs."""

import csv
import itertools
import json
import math
from types import SimpleNamespace

import numpy as np
import pytest

import sand
from sand.cli.laboratory import run_rows
from sand.cli.main import main
from sand.experiments import laboratory
from sand.experiments.laboratory import Loaded, Loading, load, plan
from sand.experiments.laboratory_figure import laboratory_figure
from sand.experiments.laboratory_job import rows_of
from sand.experiments.laboratory_loading import read_rate
from sand.experiments.laboratory_table import Percolation, percolating, shares, table_of
from sand.theory.compression import packing_scales

from ...cases import COMPRESSION

ICE = sand.ICE
PACKING = sand.setup.lattice(3, radius="0.1 um", material="ice")
SOLID = 27 * 4 / 3 * math.pi * 1e-21


def walls(kind="compress", **changes):
    """How the lattice is loaded between walls."""
    return Loading(kind, **({"rate": "1 m/s", "to": 0.4, "by": "walls", "box": "1 um"} | changes))


# --- rates and starts ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "value", "unit"),
    [
        ("1e-5 /t_c", 1e-5, "/t_c"),
        ("1e-5 1/t_c", 1e-5, "/t_c"),
        ("11/tc", 11.0, "/t_c"),
        ("2e4 1/s", 2e4, "1/s"),
        ("10 cm/s", 0.1, "m/s"),
    ],
)
def test_rates(given, value, unit):
    """A rate per time of a contact, per second, or a speed; what is read is written so that it is read again."""
    found = Loading("compress", given, 0.4, by="walls").rate
    assert found == (pytest.approx(value, rel=1e-12, abs=0.0), unit)
    assert read_rate(str(found), "rate") == found


def test_walls_touch_the_outermost_grains():
    """Floor and lid are at rest on the lattice: the gap is its height less δ0 of a grain and a wall on each side.

    δ0 of a grain and a wall of its material is that of two grains of twice the radius: a0²/(3R) with R = r.
    """
    found = plan(PACKING, walls())
    floor, lid = found.moved["walls"]
    height = np.ptp(PACKING.position[:, 2])
    rest = sand.theory.contact(ICE, "0.2 um").rest_overlap
    gap = lid.point[2] - floor.point[2]
    assert gap == pytest.approx(height + 2 * (1e-7 - rest), rel=1e-9, abs=0.0)
    assert found.sides == pytest.approx([1e-6, 1e-6, gap], rel=1e-12, abs=0.0)
    assert found.start.box.lengths == (1e-6, 1e-6, None)
    assert found.filling(found.sides) == pytest.approx(SOLID / (1e-12 * gap), rel=1e-12, abs=0.0)
    assert lid.velocity == (0.0, 0.0, -1.0) and floor.velocity == (0.0, 0.0, 0.0)
    # the lid is where φ = 0.4 at the end, and φ grows by 2 % in the last row
    end = gap - found.until
    assert SOLID / (1e-12 * end) == pytest.approx(0.4, rel=1e-12, abs=0.0)
    assert found.row_every == pytest.approx(0.02 * end, rel=1e-12, abs=0.0)
    simulation = laboratory.simulation_of(found)
    assert simulation.frame_every == found.row_every


def test_the_lid_moves_as_it_is_told():
    """Stretched it moves up, sheared along x."""
    stretched, sheared = (plan(PACKING, walls(kind, to=0.5)) for kind in ("stretch", "shear"))
    assert stretched.moved["walls"][1].velocity == (0.0, 0.0, 1.0)
    assert sheared.moved["walls"][1].velocity == (1.0, 0.0, 0.0)
    for found in (stretched, sheared):
        assert found.until == pytest.approx(0.5 * found.sides[2], rel=1e-12, abs=0.0)


def test_a_box_that_is_sheared():
    """Images above slide at the rate times the side along z; the sides stay, and rows are 0.02 of strain apart."""
    found = plan(PACKING, Loading("shear", "1e4 1/s", to=1.5))
    law = found.moved["deformation"]
    assert law.shear == 1e4 and set(law.rate) == {0.0}
    assert found.until == pytest.approx(1.5e-4, rel=1e-12, abs=0.0)
    assert found.row_every == pytest.approx(2e-6, rel=1e-12, abs=0.0)
    assert found.rate_ratio(found.sides) == pytest.approx(
        1e4 * found.sides[2] / found.scales.largest_rate(found.filling(found.sides), 1.0), rel=1e-12, abs=0.0
    )


def test_ratio_to_the_largest_rate():
    """Rate × L / (0.3 √(3E_roll/(r³ρ)) φ) at the start; between walls the speed stays, so that it falls as 1/φ."""
    found, scales = plan(PACKING, walls()), packing_scales(ICE, 1e-7)
    phi = found.filling(found.sides)
    assert found.rate_ratio(found.sides) == pytest.approx(1.0 / (0.3 * scales.wave_speed * phi), rel=1e-12, abs=0.0)
    half = found.sides * [1, 1, 0.5]
    assert found.rate_ratio(half) == pytest.approx(0.5 * found.rate_ratio(found.sides), rel=1e-12, abs=0.0)
    with pytest.warns(UserWarning, match="too fast for a static stress, .* times where the packing is densest"):
        laboratory.slow_from(plan(PACKING, walls(rate="20 m/s")))


# --- the table -------------------------------------------------------------------------------------------------------


def test_rows_of_a_constant_pressure():
    """The impulse P A Δt on a wall between two rows is the stress P; rows are kept where ln φ has grown by 0.02."""
    found = plan(PACKING, walls(rate="0.1 m/s"))
    area, gap, pressure = 1e-12, float(found.sides[2]), 700.0
    floor = found.moved["walls"][0].point[2]
    ledger = []
    for k in range(40):
        height = gap * (1 - 0.01 * k)
        row = {"time": 0.01 * k * gap / 0.1, "step": k, "contacts": 54 + k, "lost_rolling": 0.0, "lost_walls": 0.0}
        impulse = pressure * area * row["time"]
        row |= {"lid_impulse_x": 0.0, "lid_impulse_z": impulse, "floor_impulse_z": -1.01 * impulse}
        ledger.append(row | {"floor_position": floor, "lid_position": -(floor + height)})
    table = table_of(found, ledger, Percolation())
    assert math.isnan(table[0]["stress"]) and len(table) > 10
    assert [row["stress"] for row in table[1:]] == pytest.approx([pressure] * (len(table) - 1), rel=1e-9, abs=0.0)
    for name, factor in (("mean_pressure_lid", 1.0), ("mean_pressure_floor", 1.01)):
        assert table[5][name] == pytest.approx(factor * pressure, rel=1e-9, abs=0.0)
    assert (np.diff(np.log([row["filling"] for row in table]))[:-1] >= 0.02 * (1 - 1e-3)).all()
    assert table[-1]["step"] == 39
    assert table[3]["coordination"] == pytest.approx(2 * (54 + table[3]["step"]) / 27, rel=1e-12, abs=0.0)
    assert table[-1]["strain"] == pytest.approx(-0.39, rel=1e-9, abs=0.0)


def test_the_cluster_that_percolates():
    """Of a rod along x and a longer one along y, the longer one is named; without them no cluster is."""
    rod = np.arange(-4.0, 5.0, 2.0)
    x = np.concatenate([np.column_stack([rod, 0 * rod, 0 * rod + 3]), np.column_stack([0 * rod, rod, 0 * rod - 3])])
    x = np.concatenate([x, [[0.0, 0.0, -1.0]]])
    ring = np.array([[0, 1], [1, 2], [2, 3], [3, 4], [4, 0]])
    box = sand.Box.periodic(10.0)
    found = percolating(x, np.concatenate([ring, ring + 5, [[7, 10]]]), box)
    assert found == {
        "percolating": 2,
        "percolating_grain": 5,
        "percolating_size": 6,
        "percolates_x": 0,
        "percolates_y": 1,
        "percolates_z": 0,
    }
    assert percolating(x, ring[:4], box)["percolating_grain"] == -1


# --- runs ------------------------------------------------------------------------------------------------------------


@pytest.mark.compiled("contacts")
@pytest.mark.filterwarnings("ignore:the rate,")
@pytest.mark.parametrize(("kind", "to"), [("compress", 0.3), ("stretch", 0.4), ("shear", 0.4)])
def test_stress_between_walls_is_the_work_of_the_lid(kind, to):
    """The mean force, impulse over time, is at constant speed the work of the lid over its way.

    Both are sums over the same steps, by another road: rounding alone is left.
    """
    body = sand.setup.rbd(12, radius="0.1 um", material="ice", seed=1)
    found = load(body, Loading(kind, "1 m/s", to, by="walls"), seed=1)
    work, times = (np.array([row[name] for row in found.table]) for name in ("lost_walls", "time"))
    mean = -np.diff(work) / np.diff(times) / (found.plan.sides[0] * found.plan.sides[1])
    stress = np.array([row["stress"] for row in found.table[1:]])
    assert len(stress) > 5
    assert stress == pytest.approx(mean, rel=1e-9, abs=1e-9 * np.abs(mean).max())
    last = found.table[-1]
    assert last["filling" if kind == "compress" else "strain"] == pytest.approx(to, rel=1e-9, abs=0.0)
    assert last["coordination"] == 2 * last["contacts"] / 12
    assert {"percolates_x", "percolates_y", "rate_ratio", "lost_rolling", "lost_walls"} <= last.keys()
    content = found.to_dict()
    assert content["stress"] == last["stress"] and len(content["table"]["filling"]) == len(found.table)
    assert abs(content["drift"]) < 1e-3


# --- a cake, and a lid with a pressure -------------------------------------------------------------------------------


DAMPED = [sand.Contact(damping="critical")]


def cake(grains=12):
    """A deposit of grains of ice on a floor."""
    return sand.setup.deposit(grains, width="0.7 um", radius="0.1 um", material="ice", seed=3)


def pressed(pressure="10 kPa", until="1 us", kind="compress", **changes):
    """How a cake is loaded by a pressure."""
    return Loading(kind, by="walls", pressure=pressure, until=until, **changes)


@pytest.mark.compiled("small")
def test_a_cake_is_one_body_by_the_floor():
    """Trees of a deposit stand on the floor, which is at z = 0; a grain that touches neither is named."""
    start = cake(40)
    found = plan(start, pressed())
    assert found.moved["walls"][0].point[2] == pytest.approx(0.0, abs=1e-18)
    assert found.start is start and found.sides[:2] == pytest.approx([7e-7, 7e-7], rel=1e-12, abs=0.0)
    between = start.grains.copy()
    between.arrays.position[2, np.argsort(between.position[:, 2])[20:]] += 5e-8
    with pytest.raises(sand.BadInput, match=r"the body: grain \d+ .*has no contact with the rest"):
        plan(start._replace(grains=between), pressed())
    with pytest.raises(sand.BadInput, match="open along z; it must be periodic along x, y, z; `sand compress`"):
        plan(start, Loading("compress", "1e-4 /t_c", 0.4))
    with pytest.raises(sand.BadInput, match=r"box: the packing has its own, .*; leave box out"):
        plan(start, pressed(box="2 um"))


@pytest.mark.compiled("small")
def test_loads_that_follow_one_another():
    """P(t) = P₀ (P₁/P₀)^(t/T) between two pressures, to half of the largest step of the ramp, 5 %/20, and its chord.

    The chord of an exponential over ln 1.05 is above it by (ln 1.05)²/8 = 0.03 %.  The mass is that of all grains.
    """
    found = plan(cake(), pressed(["1 kPa", "20 kPa", "5 kPa"], "4 us"))
    lid, area = found.moved["walls"][1], 4.9e-13
    assert lid.mass == pytest.approx(float(found.start.grains.mass.sum()), rel=1e-12, abs=0.0)
    assert lid.velocity == (0.0, 0.0, 0.0)
    for time in np.linspace(0.0, 3.999e-6, 30):
        wanted = 1e3 * 20 ** (time / 2e-6) if time < 2e-6 else 2e4 * 0.25 ** ((time - 2e-6) / 2e-6)
        assert lid.ramps["force"].at(time) == pytest.approx(wanted * area, rel=0.002, abs=0.0)
    assert found.until == 4e-6 and found.row_every == pytest.approx(8e-8, rel=1e-12, abs=0.0)


def load_rows(found, ends, pressures=(1e4, 1e4), every=2e-7):
    """Rows of a lid at the shares `ends` of its height, with constant pressures of the grains on lid and floor."""
    floor, gap, area = found.moved["walls"][0].point[2], float(found.sides[2]), float(np.prod(found.sides[:2]))
    lid, below = (pressure * area * every for pressure in pressures)
    return [
        {"time": every * k, "floor_position": floor, "lid_position": -floor - gap * end}
        | {"lid_impulse_x": 0.0, "lid_impulse_z": lid * k, "floor_impulse_z": -below * k}
        for k, end in enumerate(ends)
    ]


FALLING, STILL = list(np.linspace(1.0, 0.9, 20)), [0.9 - 1e-5 * (k % 3) for k in range(9)]


@pytest.mark.compiled("small")
def test_rest_under_a_constant_load():
    """At rest once φ has changed by less than 1e-4 in a tenth of the time; not in the first rows, nor as it grows.

    One row more, in which it moves again, is that with which a run ends.
    """
    found = plan(cake(), pressed("10 kPa", "10 us"))
    for ends in (STILL[:4], FALLING, FALLING + STILL[:4], [*FALLING, *STILL, 0.89, 0.88]):
        assert not laboratory.at_rest(found, load_rows(found, ends))
    assert laboratory.at_rest(found, load_rows(found, FALLING + STILL))
    assert laboratory.at_rest(found, load_rows(found, [*FALLING, *STILL, 0.89]))
    assert not laboratory.at_rest(found, []) and not laboratory.at_rest(found, load_rows(found, [1.0]))


@pytest.mark.compiled("small")
@pytest.mark.parametrize("pressures", [(1e4, 1e4), (9.6e3, 1.04e4), (1.06e4, 1e4), (1e4, 9.4e3), (2e3, 0.0)])
def test_a_packing_at_rest_bears_the_load(pressures):
    """The grains press on lid and floor with the load, to 5 %; a lid that has hardly moved is not at rest."""
    found = plan(cake(), pressed("10 kPa", "10 us"))
    rows = load_rows(found, FALLING + STILL, pressures)
    borne = all(abs(one - 1e4) < 0.05 * 1e4 for one in pressures)
    assert laboratory.at_rest(found, rows) == borne
    change, *means = laboratory.recent(found, rows)
    assert means == pytest.approx(list(pressures), rel=1e-9, abs=1e-6)
    assert change == pytest.approx(2e-5 / 0.9, rel=1e-3, abs=0.0)
    text = laboratory.unrest(found, load_rows(found, FALLING + STILL, (1.2e3, -30.0)))
    assert text == (
        "not at rest after 10 us: pressure on the lid 1.2 kPa, on the floor -30 Pa, for 10 kPa, change of the filling "
        "factor 0.0022 %; give a longer until, or damping"
    )


@pytest.mark.compiled("small")
@pytest.mark.parametrize("every", [0.15, 0.5])
def test_rest_with_rows_far_apart(every):
    """Rows more than a tenth of `until` apart: the last row counts, so that also such a run may be at rest."""
    found = plan(cake(), pressed("10 kPa", "10 us", every=every))
    ends = [1.0, 0.9, *[0.9] * round(1 / every - 1)]
    assert laboratory.at_rest(found, load_rows(found, ends, every=every * 1e-5))
    assert not laboratory.at_rest(found, load_rows(found, [*ends[:-2], 0.95, 0.9], every=every * 1e-5))


@pytest.mark.compiled("contacts")
def test_a_load_that_is_not_borne_in_time():
    """A lid under 10 Pa has hardly moved when φ changes by less than 1e-4 in a tenth of 0.1 µs: this is no rest.

    The lid has the mass of all grains, 12 of 3.9e-18 kg, so that ½ (P A/M) t² is 0.02 nm of about 1 µm in the first
    fifth of the time.  Here `until` comes first, which a warning and the line of the run say.
    """
    with pytest.warns(
        UserWarning, match=r"not at rest after 100 ns: pressure on the lid .*, for 10 Pa, .*longer until"
    ):
        found = load(cake(), pressed("10 Pa", "0.1 us"), forces=DAMPED, seed=1)
    content = found.to_dict()
    assert found.simulation.time >= 1e-7 and content["at_rest"] is False
    ((_, said),) = run_rows([content | {"seed": 1}])
    assert "; not at rest; " in said


@pytest.mark.compiled("contacts")
def test_a_constant_load_ends_at_rest():
    """Before `until` the grains bear the load, to 1 %; a run that had ended takes no step if it is continued."""
    found = load(cake(), pressed("10 kPa", "10 us"), forces=DAMPED, seed=1)
    steps = found.simulation.steps
    assert found.simulation.time < 1e-5 and found.to_dict()["at_rest"] is True
    ((_, said),) = run_rows([found.to_dict() | {"seed": 1}])
    assert "; at rest; " in said
    assert found.table[-2]["mean_pressure_floor"] == pytest.approx(1e4, rel=0.01, abs=0.0)
    again = laboratory.run_to_end(found.plan, found.simulation)
    assert again.simulation.steps == steps and len(again.table) == len(found.table)


@pytest.mark.compiled("contacts")
@pytest.mark.filterwarnings("ignore:not at rest")
@pytest.mark.parametrize("pressure", ["10 kPa", ["5 kPa", "20 kPa"]])
def test_work_and_momentum_of_a_lid_with_a_pressure(pressure):
    """A lid pressed by P A: its momentum gives the mean pressure of the grains on it, the way of the lid the work.

    M v = ∫(P_lid − P) A dt along +z, for constant P; the work of the force less the kinetic energy of the lid is
    −lost_walls, P A (z₀ − z) for constant P, and between the extreme pressures for a ramp.
    """
    found = load(cake(30), pressed(pressure), forces=DAMPED, seed=1)
    table, last, lid = found.table, found.table[-1], found.simulation.walls[1]
    area, loads = found.plan.sides[0] * found.plan.sides[1], found.plan.loading.pressure
    mass = float(found.simulation.grains.mass.sum())
    times = np.diff([row["time"] for row in table])
    impulse = area * float(times @ [row["mean_pressure_lid"] for row in table[1:]])
    kinetic, way = 0.5 * mass * lid.velocity[2] ** 2, float(found.plan.sides[2] - last["side_z"])
    assert way > 1e-8 and last["filling"] > table[0]["filling"] and abs(found.to_dict()["drift"]) < 1e-3
    work = -last["lost_walls"] + kinetic
    if len(loads) == 1:
        given = loads[0] * area * last["time"]
        assert impulse - given == pytest.approx(mass * lid.velocity[2], abs=1e-9 * given)
        assert work == pytest.approx(loads[0] * area * way, rel=1e-9, abs=0.0)
    else:
        assert loads[0] * area * way < work < loads[1] * area * way
        assert last["mean_pressure_lid"] == pytest.approx(loads[1], rel=0.05, abs=0.0)
    assert [row["stress"] for row in table[1:]] == [row["mean_pressure_lid"] for row in table[1:]]


@pytest.mark.compiled("contacts")
@pytest.mark.filterwarnings("ignore:the rate,")
def test_shear_under_a_pressure():
    """The lid slides with its speed v_x while P holds it: −lost_walls = Σ τ A v_x Δt + P A (z₀ − z) − ½ M v_z².

    τ comes from the impulse along x, the work from the sum over steps; its height is free.
    """
    found = load(cake(30), pressed("10 kPa", None, "shear", rate="1 m/s", to=0.3), forces=DAMPED, seed=1)
    table, last, lid = found.table, found.table[-1], found.simulation.walls[1]
    area, mass = found.plan.sides[0] * found.plan.sides[1], float(found.simulation.grains.mass.sum())
    times = np.diff([row["time"] for row in table])
    sheared = float(times @ [row["stress"] for row in table[1:]]) * area * 1.0
    along = 1e4 * area * float(found.plan.sides[2] - last["side_z"]) - 0.5 * mass * lid.velocity[2] ** 2
    assert -last["lost_walls"] == pytest.approx(sheared + along, rel=1e-9, abs=1e-9 * abs(along))
    assert last["strain"] == pytest.approx(0.3, rel=1e-9, abs=0.0)
    assert last["filling"] != table[0]["filling"] and sheared != 0.0


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"by": "box"}, "pressure is for by = 'walls'; a periodic box follows a pressure in a case of `sand run`"),
        ({"kind": "stretch", "rate": "1 m/s", "to": 0.1}, "pressure presses the lid"),
        ({"kind": "shear", "pressure": ["1 kPa", "2 kPa"], "until": None, "rate": "1 m/s", "to": 1}, "shear takes one"),
        ({"until": None}, "until is missing; add it, for example until = '100 us'"),
        ({"to": 0.4}, "to is not used by compress with a pressure, which has until; leave it out"),
        ({"pressure": 1e3, "rate": "1 m/s"}, "rate is not used by compress with a pressure"),
        ({"pressure": None, "rate": "1 m/s"}, "to is missing; add it, for example to = 0.4"),
        ({"pressure": "5 N"}, "pressure = '5 N'"),
        ({"pressure": []}, r"pressure = \[\] has no pressure"),
        ({"pressure": ["1 kPa", -1]}, r"pressure\[1\] = -1 must be above 0"),
    ],
)
def test_errors_of_a_pressure(given, message):
    """One line each: what is not used or missing, and what to do."""
    with pytest.raises(sand.BadInput, match=message):
        Loading(**({"kind": "compress", "by": "walls", "pressure": "1 kPa", "until": "1 us"} | given))


@pytest.mark.draws
@pytest.mark.compiled("deformation")
@pytest.mark.filterwarnings("ignore:the rate,")
@pytest.mark.parametrize("kind", ["compress", "stretch"])
def test_stress_in_a_box_is_the_mean_of_its_axes(kind):
    """Work over the change of volume, beside the work along each axis that the ledger has in columns of its own.

    Both divide by the same ∫V dL/L, that of the ledger with the logarithmic mean of V: rounding is left. A step strains
    a side by 1 + x in place of e^x, x = rate × dt = 2e-5: the end is off by x/2 of ln(L/L₀).
    """
    body = sand.setup.rbd(12, radius="0.1 um", material="ice", seed=1)
    found = load(body, Loading(kind, "1e6 1/s", 0.2, every=0.05), seed=1)
    table, compressed = found.table[1:], kind == "compress"
    mean = np.array([np.mean([row[f"mean_pressure_{axis}"] for axis in found.plan.loading.axes]) for row in table])
    stress = np.array([row["stress"] for row in table])
    assert len(stress) > 3 and stress.any()
    assert (stress if compressed else -stress) == pytest.approx(mean, rel=1e-6, abs=1e-6 * np.abs(mean).max())
    labels = [axes.get_ylabel() for axes in found.simulation.figure().axes]
    assert [label[:3] for label in labels].count("$P$") == 1
    last, sides = table[-1], found.plan.sides
    assert last["filling" if compressed else "strain"] == pytest.approx(0.2, rel=1e-4, abs=0.0)
    factors = [last[f"side_{axis}"] / side for axis, side in zip("xyz", sides, strict=True)]
    assert factors[1:] == pytest.approx([factors[0]] * 2 if compressed else [1.0] * 2, rel=1e-9, abs=0.0)


@pytest.mark.compiled("shear")
@pytest.mark.filterwarnings("ignore:the rate,")
def test_shear_stress_of_a_box():
    """Σ τ V Δγ over the rows is what the packing gained and lost: by energies alone, without the work of the box.

    The ledger closes to 1 %: the flow meets the dashpots of a body that begins at rest within one step. The strain is
    rate × time.
    """
    body = sand.setup.rbd(12, radius="0.1 um", material="ice", seed=1)
    found = load(body, Loading("shear", "5e6 1/s", 1.2, every=0.05), forces=[sand.Contact(damping="critical")], seed=1)
    rows, ledger = found.table, found.simulation.ledger.rows
    volume = float(np.prod(found.plan.sides))
    done = sum(b["stress"] * volume * (b["strain"] - a["strain"]) for a, b in itertools.pairwise(rows))
    gained = [row["total"] - row["lost_box"] for row in (ledger[0], ledger[-1])]
    assert done == pytest.approx(gained[1] - gained[0], rel=1e-2, abs=0.0) and done > 0.0
    assert rows[-1]["strain"] == pytest.approx(1.2, rel=1e-6, abs=0.0) and len(rows) > 20
    assert rows[-1]["filling"] == rows[0]["filling"] and {"tilt", "lost_rolling"} <= rows[-1].keys()


def test_scales_are_those_of_the_contacts():
    """E_roll = 12π²γRξ_c f_roll with γ times the factor of the contact model; t_c follows from the same γ."""
    found = plan(PACKING, walls(), [sand.Contact(surface_energy_factor=0.5, roll_factor=8.0)]).scales
    energy = 12.0 * math.pi**2 * 0.5 * ICE.surface_energy * 0.5e-7 * ICE.rolling_limit * 8.0
    assert found.roll_energy == pytest.approx(energy, rel=1e-12, abs=0.0)
    half = sand.Material.like("ice", surface_energy=0.5 * ICE.surface_energy)
    assert found.time == pytest.approx(packing_scales(half, 1e-7).time, rel=1e-12, abs=0.0)
    assert found.surface_energy == pytest.approx(0.5 * ICE.surface_energy, rel=1e-12, abs=0.0)


def test_an_end_where_grains_would_touch_through_two_images():
    """27 grains at φ = 0.7 fill a cube of 0.545 µm, less than 2 (2r + r) = 0.6 µm; at φ = 0.5 it has 0.609 µm."""
    plan(PACKING, Loading("compress", "1e-4 /t_c", 0.5, box="1 um"))
    with pytest.raises(sand.BadInput, match=r"to = 0\.7: a side of the box is 545 nm then; with less than 600 nm"):
        plan(PACKING, Loading("compress", "1e-4 /t_c", 0.7, box="1 um"))


def test_folders_without_a_frame(tmp_path, monkeypatch, capsys):
    """A file that is missing, and a folder of other runs, are refused with what they are; `view` does not wait."""
    monkeypatch.chdir(tmp_path)
    body = '[aggregate]\nkind = "file"\nfilling = 0.1\nfile = "old"\n'
    (tmp_path / "pull.toml").write_text(body + '[stretch]\nrate = "1e-4 /t_c"\nto = 0.1\nseeds = [2]\n')
    assert main(["stretch", "pull.toml"]) == 2
    assert f"there is no file {tmp_path / 'old'}" in capsys.readouterr().err
    (tmp_path / "old/seed-1").mkdir(parents=True)
    assert main(["stretch", "pull.toml"]) == 2
    assert f"file, for seed 2: {tmp_path / 'old'} holds a run for each seed" in capsys.readouterr().err
    (tmp_path / "old/case.toml").write_text(COMPRESSION)
    monkeypatch.setattr("sand.cli.view.WAIT", 0.0)
    assert main(["view", "old", "--html", "page.html"]) == 2
    assert "old holds a run for each seed" in capsys.readouterr().err


@pytest.mark.compiled("contacts")
@pytest.mark.filterwarnings("ignore:the rate,")
def test_a_job(tmp_path, monkeypatch, capsys):
    """`sand compress` writes table, results and runs; resumed its rows are the same; info describes all."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cake.toml").write_text(COMPRESSION)
    assert main(["info", "cake.toml"]) == 0
    assert "E_roll" in (text := capsys.readouterr().out) and "sand compress cake.toml" in text
    assert main(["compress", "cake.toml", "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert [run["seed"] for run in content["runs"]] == [1, 2]
    assert content["runs"][0]["table"] != content["runs"][1]["table"]
    with open("cake/results.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == sum(len(run["table"]["filling"]) for run in content["runs"])
    assert sand.open("cake/seed-2").frames[0].time == 0.0
    before = (tmp_path / "cake/results.csv").read_bytes()
    # as if killed while the second run wrote its last rows
    (tmp_path / "cake/laboratory.json").unlink()
    (tmp_path / "cake/results.csv").unlink()
    assert main(["resume", "cake", "--quiet"]) == 0
    assert (tmp_path / "cake/results.csv").read_bytes() == before
    capsys.readouterr()
    assert main(["info", "cake"]) == 0 and "seed 2" in capsys.readouterr().out
    assert main(["compress", "cake.toml"]) == 2 and "not empty" in capsys.readouterr().err
    # a frame of this run is stretched
    (tmp_path / "pull.toml").write_text(
        '[aggregate]\nkind = "file"\nfile = "cake"\nfilling = 0.25\n[stretch]\nrate = "1 m/s"\nto = 0.1\nby = "walls"\n'
        '[forces.contact]\ndamping = "critical"\n'
    )
    assert main(["stretch", "pull.toml", "--json"]) == 0
    pulled = json.loads(capsys.readouterr().out)["runs"][0]
    assert pulled["filling_at_start"] == pytest.approx(0.25, rel=0.05, abs=0.0)
    assert pulled["strain"] == pytest.approx(0.1, rel=1e-6, abs=0.0)
    # the frames of all seeds are read before the first run
    text = (tmp_path / "pull.toml").read_text()
    (tmp_path / "pull.toml").write_text(text.replace("to = 0.1\n", "to = 0.1\nseeds = [1, 3]\n"))
    for command in (["info", "pull.toml"], ["stretch", "pull.toml", "--out", "none"]):
        assert main(command) == 2 and "file, for seed 3: " in capsys.readouterr().err
    assert not (tmp_path / "none").exists()
    # what a run has is not given again
    (tmp_path / "pull.toml").write_text(text.replace('"file"\n', '"file"\nradius = "1 um"\n'))
    assert main(["info", "pull.toml"]) == 2 and "has it; leave radius out" in capsys.readouterr().err


@pytest.mark.compiled("contacts")
@pytest.mark.filterwarnings("ignore:the rate,")
def test_a_sweep_over_the_end(tmp_path, monkeypatch, capsys):
    """`sand sweep` varies a key of [compression]; the rows of all runs are those of the job, and are drawn."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cake.toml").write_text(COMPRESSION)
    how = ["--vary", "compression.to=0.28,0.3", "--seeds", "2-2", "--files", "none", "--out", "swept", "--quiet"]
    assert main(["sweep", "cake.toml", *how]) == 0
    table = sand.open("swept").table
    assert table["compression.to"].tolist() == [0.28, 0.3]
    assert table["filling"] == pytest.approx([0.28, 0.3], rel=1e-9, abs=0.0)
    assert not [name for name in table if name.startswith("table")]
    rows = sand.open("swept").rows
    assert list(rows)[:3] == ["compression.to", "seed", "time"] and list(rows)[-1] == "run"
    of_first = rows["run"] == table["run"][0]
    assert (rows["compression.to"] == np.where(of_first, 0.28, 0.3)).all()
    assert 0 < of_first.sum() < (~of_first).sum()
    assert rows["filling"][~of_first][-1] == table["filling"][1] and np.isnan(rows["stress"][~of_first][0])
    # the same packing, loaded by the job of the other command
    assert main(["compress", "cake.toml", "--seeds", "2-2", "--quiet"]) == 0
    with open("cake/results.csv", encoding="utf-8") as file:
        job = list(csv.DictReader(file))
    assert [row["stress"] for row in job][1:] == [repr(v) for v in rows["stress"][~of_first][1:].tolist()]
    capsys.readouterr()
    for folder, what, names in (("swept", None, ["laboratory"]), ("cake", "laboratory,coordination", None)):
        assert main(["plot", folder, *(["--what", what] if what else []), "--json"]) == 0
        files = [path.rpartition("/")[2] for path in json.loads(capsys.readouterr().out)["files"]]
        assert files == [f"{name}.png" for name in names or what.split(",")]
    assert main(["plot", "cake", "--what", "stres"]) == 2 and "did you mean 'stress'" in capsys.readouterr().err
    for name, text in (("swept/rows.csv", "the rows of the tables of all runs"), ("cake/results.csv", "of all runs")):
        assert main(["info", name]) == 0 and text in (said := capsys.readouterr().out) and "coordination" in said


def outcome(seed, kind="compress", noise=0.0):
    """An outcome whose pressure is 5e5 φ³, and whose losses are of rolling alone."""
    phi = np.geomspace(0.02, 0.3, 40)
    table = {"mean_filling": phi, "strain": 3 * phi, "stress": 5e5 * phi**3 * (1 + noise), "coordination": 2 + phi}
    table |= {
        "share_rolling": 0 * phi + 1,
        "share_sliding": 0 * phi,
        "share_twisting": 0 * phi,
        "rate_ratio": 0.1 / phi,
    }
    scales = {"kind": kind, "largest_load": 0.0, "grains": 512, "roll_energy": 4.74e-16, "pressure_scale": 4.74e5}
    scales |= {"filling_at_start": 0.1, "surface_energy": 0.1, "radius": 1e-7, "largest_at_end": kind == "stretch"}
    return {"seed": seed, "table": {name: column.tolist() for name, column in table.items()}} | scales


@pytest.mark.parametrize("kind", ["compress", "stretch"])
def test_figure(kind):
    """Lines are where the outcomes are: P, the share 1 of rolling, Z; open below φ = 0.1, where loading is too fast."""
    figure = laboratory_figure([outcome(1, kind), outcome(2, kind, noise=0.1)])
    stress, z, shares = figure.axes[:3]
    line, fast = stress.get_lines()[slice(2) if kind == "compress" else slice(1, 3)]
    x, y = (np.array(one) for one in line.get_data())
    phi = x if kind == "compress" else x / 3
    static = phi > 0.1
    assert y[static] == pytest.approx(1.05 * 5e5 * phi[static] ** 3, rel=2e-2, abs=0.0)
    assert np.isnan(y[phi < 0.099]).all() and (np.isnan(y) != np.isnan(fast.get_ydata())).all()
    assert next(one for one in shares.get_lines() if one.get_label() == "rolling").get_ydata() == pytest.approx(
        np.ones(len(x)), rel=1e-12, abs=0.0
    )
    assert z.get_lines()[0].get_ydata()[static] == pytest.approx(2 + phi[static], rel=1e-3, abs=0.0)
    title = stress.get_legend().get_title().get_text()
    assert "too fast" in title and ("no strength" in title) == (kind == "stretch")


def test_figure_of_a_sweep():
    """Each combination of values has a curve, and a column may be drawn alone."""
    runs = [outcome(seed) | {"group": f"to = {end}"} for seed in (1, 2) for end in (0.2, 0.3)]
    lines = laboratory_figure(runs).axes[1].get_lines()
    assert [one.get_label() for one in lines if one.get_label().startswith("to")] == ["to = 0.2", "to = 0.3"]
    alone = laboratory_figure(runs, "coordination").axes
    assert len(alone) == 1 and alone[0].get_ylabel() == "coordination"


def test_shares_of_what_is_dissipated():
    """Of 1 + 2 + 3 + 2 J that are lost between two rows, a normal dashpot included; the work of a wall is no loss."""
    before = {"lost_rolling": 1.0, "lost_sliding": 1.0, "lost_twisting": 0.0, "lost_damping_normal": 5.0}
    row = {"lost_rolling": 2.0, "lost_sliding": 3.0, "lost_twisting": 3.0, "lost_damping_normal": 7.0}
    found = shares(before | {"lost_walls": 0.0}, row | {"lost_walls": -100.0})
    assert found == {"share_rolling": 1 / 8, "share_sliding": 2 / 8, "share_twisting": 3 / 8}
    assert set(shares(None, row).values()) == {0.0}


@pytest.mark.parametrize(("kind", "end", "text"), [
    ("stretch", 5.0, "5 kPa at most, where it still rises: that is no strength"),
    ("stretch", 3.0, "4 kPa at most, at strain 0.2"),
    ("compress", 5.0, "5 kPa at most;"),
])  # fmt: skip
def test_a_tension_that_still_rises(kind, end, text):
    """The largest stress of a stretch is a strength only if the stress has fallen after it."""
    planned = plan(PACKING, Loading(kind, "1e-4 /t_c", 0.3, box="1 um"))
    stresses = [math.nan, 2e3, 4e3, 1e3 * end]
    table = [
        {"stress": one, "strain": 0.1 * k, "time": 0.0, "step": k, "filling": 0.1, "coordination": 2.0}
        for k, one in enumerate(stresses)
    ]
    content = Loaded(planned, table, SimpleNamespace(ledger=SimpleNamespace(drift=0.0))).to_dict()
    assert content["largest_stress"] == max(4e3, 1e3 * end) and content["largest_at_end"] == (end == 5.0)
    ((_, said),) = run_rows([content | {"seed": 1}])
    assert text in said


def test_figure_of_a_load():
    """Under a load φ is also drawn over time; P(φ) of the rows in which φ is larger than in all before."""
    run = outcome(1)
    table = {name: np.array(column) for name, column in run["table"].items()}
    phi, number = table["mean_filling"].copy(), np.arange(40.0)
    order = np.concatenate([number, number[20:30]]).astype(int)  # expands again from row 40 on
    table = {name: column[order] for name, column in table.items()} | {"time": np.arange(50.0), "filling": phi[order]}
    run |= {"largest_load": 1e4, "table": {name: column.tolist() for name, column in table.items()}}
    over_time, stress = laboratory_figure([run]).axes[:2]
    assert over_time.get_lines()[0].get_ydata() == pytest.approx(phi[order][1:], rel=1e-12, abs=0.0)
    x, y = stress.get_lines()[0].get_data()
    slow = x > 0.1  # points of rows that are too fast are drawn apart
    assert y[slow] == pytest.approx(5e5 * x[slow] ** 3, rel=2e-2, abs=0.0)
    assert x[-1] == pytest.approx(phi[-1], rel=1e-9, abs=0.0)
    floor, lid = np.full(50, 1e3), np.full(50, 1.24e3)
    lid[:25] = 1.26e3  # differs by more than a fifth of itself
    table |= {"mean_pressure_floor": floor, "mean_pressure_lid": lid}
    lines = laboratory_figure([run | {"table": {k: v.tolist() for k, v in table.items()}}]).axes[1].get_lines()
    x, y = lines[0].get_data()
    assert np.isnan(y[x < phi[23]]).all() and not np.isnan(y[(x > phi[26]) & (x > 0.1)]).any()
    x, y = laboratory_figure([run | {"kind": "shear"}]).axes[0].get_lines()[0].get_data()
    assert x == pytest.approx(3 * y, rel=1e-12, abs=0.0)  # the strain of these rows is 3φ


def test_rows_have_their_seed():
    """Rows of the table of all runs begin with the seed."""
    rows = rows_of(outcome(7))
    assert len(rows) == 40 and rows[3]["seed"] == 7 and list(rows[0])[:2] == ["seed", "mean_filling"]
