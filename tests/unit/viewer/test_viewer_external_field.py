"""Description of a run's external magnetic field for the viewer."""

import numpy as np
import pytest

import sand
from sand.viewer.dataset import run_dataset
from sand.viewer.external_field import describe_field, read_field


@pytest.mark.compiled("fields")
def test_description_of_a_field(finished_run):
    """A rotating field has a direction per frame, a fixed one has one direction, no field is null."""
    folder, sim = finished_run
    description = run_dataset(folder, read_field(folder)).manifest()["field"]
    assert "rotating" in description["text"] and "1 mT" in description["text"]
    expected = [np.array(sim.forces[2].flux_density_at(t)) * 1e3 for t in sim.ledger["time"]]
    assert np.array(description["directions"]) == pytest.approx(np.array(expected), abs=1e-8)
    steady = run_dataset(folder, describe_field([sand.Field([0.0, 3e-3, 4e-3])])).manifest()["field"]
    assert steady["direction"] == [0.0, 0.6, 0.8] and "directions" not in steady
    assert steady["size"] == pytest.approx(5e-3, rel=1e-9, abs=0.0) and "sizes" not in steady
    assert description["size"] == pytest.approx(1e-3, rel=1e-9, abs=0.0) and "sizes" not in description
    times = np.array(sim.ledger["time"])
    ramp = sand.Field("1 mT", "ramp", final="2 mT", end=times[-1])
    rising = run_dataset(folder, describe_field([ramp])).manifest()["field"]
    assert rising["sizes"] == pytest.approx((1e-3 * (1.0 + times / times[-1])).tolist(), rel=1e-8, abs=0.0)
    assert "directions" not in rising
    assert describe_field([sand.Field(0.0)]) is None and run_dataset(folder).manifest()["field"] is None
    texts = {
        "constant": describe_field([sand.Field("2 mT")])[0],
        "oscillating at 1 MHz": describe_field([sand.Field(0.0, "oscillating", amplitude="1 mT", frequency="1 MHz")])[
            0
        ],
        "to 2 mT at 1 us": describe_field([sand.Field("1 mT", "ramp", final="2 mT", end="1 us")])[0],
    }
    assert all(phrase in text for phrase, text in texts.items()), texts


class UserField:
    """A user's own force that brings a magnetic field."""

    name = "homemade"

    def flux_density_size(self):
        """Its largest magnitude."""
        return 2e-3

    def flux_density_at(self, time):
        """Grows with time."""
        return np.array([0.0, 2e-3 * time, 0.0])


def test_fields_add_up():
    """Of two fields, one of a user's own force, the sum is described and both are named."""
    text, at = describe_field([sand.Field([1e-3, 0.0, 0.0]), sand.Contact(), UserField()])
    assert text == "1 mT, constant + homemade"
    np.testing.assert_allclose(at(0.5), [1e-3, 1e-3, 0.0])


@pytest.mark.compiled("fields")
def test_pictures_and_pages_have_the_same_field(finished_run):
    """`flux_density` of an opened run equals the field sent to the page; None without a case."""
    folder, sim = finished_run
    for time in sim.ledger["time"]:
        np.testing.assert_array_equal(sand.open(folder).flux_density(time), read_field(folder)[1](time))
    assert read_field(folder.parent) is None
