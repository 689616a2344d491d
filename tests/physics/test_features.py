"""Features of a simulation together: which pairs are refused, and that all others take steps whose energy is booked."""

import itertools

import pytest

from .. import features


def takes_steps(*names: str) -> None:
    """Ten steps; E + losses change by less than 1 % of all energies: a term that is not booked at all is as large.

    Grains start at rest in contact, so that the energies of contacts and of motion are of one size.
    """
    sim = features.simulation(*names)
    sim.run(steps=10)
    assert sim.steps >= 10 and sim.is_sound  # a cycle of r-RESPA is completed
    assert abs(sim.ledger.drift) < 0.01


def test_the_table_of_the_docs_is_that_of_the_code():
    """`python -m tests.features` writes it."""
    assert features.PAGE.read_text("utf-8") == features.written()


@pytest.mark.compiled("contacts", "dipoles", "listed", "fields")
@pytest.mark.parametrize("name", features.FEATURES)
def test_each_feature_takes_steps(name):
    """Alone."""
    takes_steps(name)


@pytest.mark.validate
@pytest.mark.compiled("contacts", "dipoles", "listed", "fields")
@pytest.mark.parametrize("pair", list(itertools.combinations(features.FEATURES, 2)), ids=" with ".join)
def test_each_pair_that_is_not_refused_takes_steps(pair):
    """Two features."""
    if reason := features.refusal(*pair):
        pytest.skip(reason)
    takes_steps(*pair)
