"""Ramps of parameters: values, moments of change, errors, and case files."""

import math

import pytest

import sand
from sand.basics.ramps import force_at, ramps_of
from sand.config.case import ForcesSection

LINE = sand.Ramp([0.0, 10.0, 4.0], ["1 us", "2 us", "3 us"], steps=10)


def test_values_are_those_of_the_line_in_the_middle_of_each_interval():
    """Interval k of n of a line from a to b: a + (k + 1/2)(b − a)/n; constant outside of the points."""
    assert LINE.at(0.0) == 0.0 and LINE.at(3e-6) == LINE.at(1.0) == 4.0
    assert LINE.at(1e-6) == pytest.approx(0.5, rel=1e-6, abs=0.0) and LINE.at(1.99e-6) == pytest.approx(
        9.5, rel=1e-6, abs=0.0
    )
    assert LINE.at(2.31e-6) == pytest.approx(10.0 - 6.0 * 0.35, rel=1e-6, abs=0.0)
    vectors = sand.Ramp([(0.0, 1.0, 0.0), (2.0, 1.0, 0.0)], [0.0, 1.0], steps=2)
    assert vectors.at(0.7) == pytest.approx((1.5, 1.0, 0.0), rel=1e-6, abs=0.0)


@pytest.mark.parametrize("end", [3e-6, 0.1 + 0.2, 1e-12, 7.0])
def test_each_change_begins_the_next_interval(end):
    """From one change to the next there are n + 1 changes per line, each with a new value, whatever the rounding."""
    ramp, time, seen = sand.Ramp([0.0, 1.0], [0.0, end], steps=997), -1.0, []
    while (later := ramp.next_change(time)) < math.inf:
        assert later > time and ramp.interval(later) != ramp.interval(time)
        assert ramp.interval(math.nextafter(later, -math.inf)) == ramp.interval(time)
        time = later
        seen.append(ramp.at(time))
    assert time == end and len(seen) == 998 and seen == sorted(set(seen))


def test_two_points_at_one_time_are_a_jump():
    jump = sand.Ramp(["20 mT", "0 T"], ["2 us", "2 us"])
    assert jump.next_change(0.0) == 2e-6 and jump.next_change(2e-6) == math.inf
    field = sand.Field(jump)
    assert force_at(field, 1.9e-6) == sand.Field("20 mT") and force_at(field, 2e-6) == sand.Field("0 T")
    assert field.flux_density_at(3e-6) == (0.0, 0.0, 0.0) and field.flux_density_size() == 0.02


def test_case_files_have_the_same_ramps():
    """The settings of a force with ramps, as in case.toml, give an equal force; other ramps do not."""
    tables = {
        "field": {"flux_density": {"values": ["1 mT", ["2 mT", 0, 0]], "times": ["1 us", "2 us"], "steps": 50}},
        "gravity": {"acceleration": {"values": ["9.81 m/s^2", 0], "times": [0, "1 us"]}},
        "gas": {"temperature": "300 K", "pressure": {"values": ["1 Pa", "2 Pa"], "times": [0, "1 us"]}},
        "contact": {"surface_energy_factor": {"values": [1, "0.1"], "times": ["1 us", "2 us"]}},
        "screened_charges": {"screening_length": {"values": ["1 um", "2 um"], "times": ["1 us", "2 us"]}},
    }
    forces = ForcesSection.model_validate(tables).build()
    again = ForcesSection.model_validate({force.name: force.parameters() for force in forces}).build()
    assert forces == again and all(ramps_of(force) for force in forces)
    assert ramps_of(forces[0])["flux_density"].values == ((0.0, 0.0, 1e-3), (2e-3, 0.0, 0.0))
    assert ramps_of(forces[1])["acceleration"].values == ((0.0, 0.0, -9.81), (0.0, 0.0, 0.0))
    assert forces[0] != sand.Field("1 mT") != forces[0] and forces[3] != sand.Contact()
    assert forces[4].automatic(sand.Grains([[0, 0, 0]], 1e-8, sand.SILICA), 1.0).radius == pytest.approx(
        2e-5, rel=1e-6, abs=0.0
    )
