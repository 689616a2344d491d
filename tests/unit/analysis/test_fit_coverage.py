"""95 % intervals of growth laws contain the true values of synthetic ensembles about as often as they state."""

import csv
import math

import numpy as np
import pytest
from scipy.stats import t

from sand.analysis.fits import mean_interval
from sand.basics.errors import BadInput
from tests.reference.fit_coverage import CASES, ENSEMBLES, TABLE, coverage

SYMMETRIC = "mean S, lognormal, symmetric interval"
MOST = 0.99


def test_interval_of_a_mean():
    """exp(m + s²/2 ± t √(s²/n + s⁴/2(n − 1))): of e⁰ and e², m = 1, s² = 2, n = 2, t = 12.7."""
    low, high = mean_interval(np.array([1.0, math.e**2]))
    half = t.ppf(0.975, 1) * math.sqrt(2.0 / 2.0 + 4.0 / 2.0)
    assert math.log(low) == pytest.approx(2.0 - half, rel=1e-6, abs=0.0) and math.log(high) == pytest.approx(
        2.0 + half, rel=1e-6, abs=0.0
    )
    assert mean_interval(np.full(3, 2.0)) == pytest.approx((2.0, 2.0), rel=1e-6, abs=0.0)
    assert np.isnan(mean_interval(np.ones(1))).all()
    with pytest.raises(BadInput, match="finite and above 0"):
        mean_interval(np.array([1.0, 0.0]))


def test_table_of_coverage_is_complete():
    """The committed table has a row for each case, and no interval in use covers less than 90 %."""
    rows = {row["quantity"]: row for row in csv.DictReader(TABLE.open(encoding="utf-8"))}
    assert list(rows) == list(CASES)
    for name, row in rows.items():
        assert int(row["ensembles"]) >= 0.98 * ENSEMBLES[name]
        assert name == SYMMETRIC or float(row["coverage"]) >= 0.9


@pytest.mark.validate
@pytest.mark.parametrize("name", CASES)
def test_coverage(name):
    """With another seed the coverage is the table's within four errors of the difference, √(p(1 − p)(1/n + 1/n')).

    n' is at most 60 for z, whose ensembles take a tenth of a second each. p is at most 0.99 in this error, so that a
    share of 1 has one.
    """
    kept = next(row for row in csv.DictReader(TABLE.open(encoding="utf-8")) if row["quantity"] == name)
    count = min(ENSEMBLES[name], 60) if name.startswith("z") else ENSEMBLES[name]
    found = coverage(name, count, seed=2)
    p = min(float(kept["coverage"]), MOST)
    error = math.sqrt(p * (1.0 - p) * (1.0 / ENSEMBLES[name] + 1.0 / count))
    assert abs(float(found["coverage"]) - float(kept["coverage"])) < 4.0 * error
