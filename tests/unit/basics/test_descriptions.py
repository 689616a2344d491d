"""Representations: the arguments of an object with units, from which Python makes an equal object."""

import dataclasses
import math

import numpy as np
import pytest

import sand
from sand.basics.descriptions import changed_arguments, units_of
from sand.basics.units import exact_quantity, in_unit
from sand.forces.registry import FORCES
from sand.integrate.registry import INTEGRATORS

OBJECTS = [
    sand.Box(),
    sand.Box.periodic("1.2 um", None, 0.1 + 0.2),
    *(getattr(sand, name) for name in ("ICE", "SILICA", "GRAPHITE", "FORSTERITE", "IRON", "MAGNETITE")),
    sand.Contact(damping="critical", bath_temperature="300 K", settling_time=1 / 3),
    sand.Contact(damping="constant", damping_constant="2e-9 kg/s", slide_factor=0.5),
    sand.Dipoles(cutoff="3 um", cut="sharp"),
    sand.Charges(periodic="ewald", accuracy=1e-4),
    sand.Attraction(cutoff=None),
    sand.ScreenedCharges("0.3 um"),
    sand.Gas(300.0, pressure="1 Pa", wind=(1, 0, "2 km/s"), brownian=False),
    sand.Gravity((0, 0, -9.81)),
    sand.ElectricField((0, 1e3, 0)),
    sand.Field("1 mT", shape="rotating", amplitude=(2e-3, 0, 0), frequency="1 kHz", phase="90 deg", axis=(0, 0, 1)),
    sand.Verlet(step="1 ps", far="taylor", far_steps=12),
    sand.RigidClusters(longest_step="2 ns"),
    sand.Neighbours("cells", margin=1e-7),
]


@pytest.mark.parametrize("thing", OBJECTS, ids=lambda thing: repr(thing)[:40])
def test_a_representation_makes_an_equal_object(thing):
    """repr(x) is Python that makes x again, bit by bit; it has no argument that is the default."""
    again = eval(repr(thing), vars(sand) | {name: getattr(sand, name) for name in sand.__all__})
    assert again == thing
    for name in changed_arguments(thing):
        default = {field.name: field.default for field in dataclasses.fields(thing)}[name]
        assert getattr(thing, name) != default


def test_lengths_times_and_fields_have_units():
    """Text with a unit wherever the docstring of the class gives one."""
    assert repr(sand.Dipoles(cutoff=3e-6)) == "Dipoles(cutoff='3 um')"
    assert repr(sand.Gravity((0, 0, -9.81))) == "Gravity(acceleration=(0, 0, '-9.81 m/s^2'))"
    assert repr(sand.Verlet()) == "Verlet()"
    boxes = sand.Box.open(), sand.Box.periodic(1.2e-6), sand.Box.periodic("1 um", None, "2 um")
    assert list(map(repr, boxes)) == ["Box.open()", "Box.periodic('1.2 um')", "Box.periodic('1 um', None, '2 um')"]
    assert "density='7874 kg/m^3', surface_energy='3 J/m^2', young_modulus='210 GPa'" in repr(sand.IRON)
    result = sand.Result(sand.Outcome.FINISHED, 3, 2.5e-6, 0.0)
    assert repr(result) == "Result(outcome=Outcome.FINISHED, steps=3, time='2.5 us', drift=0.0)"


@pytest.mark.parametrize("kind", [*FORCES.values(), *INTEGRATORS.values(), sand.Neighbours, sand.Material, sand.Box])
def test_units_of_docstrings_are_units(kind):
    """Every text in brackets that is taken for the unit of an argument is one: 1 of it converts to itself."""
    for unit in units_of(object.__new__(kind)).values():
        assert in_unit(f"1 {unit}", unit) == 1.0


def test_exact_quantities():
    """Text of random numbers of all magnitudes is read as the same bits, also close to the steps of prefixes."""
    rng = np.random.default_rng(1)
    numbers = [*rng.normal(size=400) * 10.0 ** rng.integers(-30, 30, 400), 1e3, 999.9999999999999, 1e-9, -2.5e-6, 0.0]
    for unit in ("m", "s", "kg/m^3", "A m^2/kg", "m/s", "Pa", "rad", "K"):
        for number in numbers:
            text = exact_quantity(float(number), unit)
            assert in_unit(text, unit) == number and math.copysign(1.0, number) == math.copysign(
                1.0, in_unit(text, unit)
            )
    assert [exact_quantity(v, "m") for v in (1.2e-6, 0.1 + 0.2)] == ["1.2 um", "0.30000000000000004 m"]
    assert exact_quantity(2650.0, "kg/m^3") == "2650 kg/m^3"
