"""When a run is stopped because its energy runs away: `Ledger.runs_away`."""

import pytest

from sand.simulation.ledger import Ledger


def rows(start, **now):
    """A ledger with a row of a kinetic energy [J] at the start, and a later row whose total is the sum of its parts."""
    ledger = Ledger()
    blank = dict.fromkeys(ledger.columns, 0.0)
    ledger.add(blank | {"translation": start, "total": start})
    return ledger, blank | {"time": 1.0, "total": sum(now.values())} | now


@pytest.mark.parametrize(
    ("now", "runs_away"),
    [
        ({"lost_damping_normal": 1.0}, False),  # all that was there is dissipated
        ({"lost_damping_normal": 1.4}, False),  # error 0.4 of 1 J
        ({"lost_damping_normal": 1.6}, True),
        # a potential well gives 9 J more than there was, and all is dissipated
        ({"magnetic": -9.0, "lost_damping_normal": 10.0}, False),
        # a drive puts in 99 J, which are dissipated
        ({"lost_outside": -99.0, "lost_damping_rolling": 100.0}, False),
        # 100 J are dissipated, 40 of which nothing has given: 0.4 of the losses, but 0.65 of the energies
        ({"translation": 1.0, "magnetic": -60.0, "lost_damping_normal": 100.0}, True),
        # losses run away: 25 J of 50 booked as dissipated came from nowhere, with 1 J in the system
        ({"magnetic": -24.0, "lost_damping_normal": 50.0}, True),
        ({"lost_settling": float("nan")}, True),
    ],
)
def test_losses_do_not_hide_an_energy_error(now, runs_away):
    """The change of the total is compared with half of Σ|E| at the start and now and of the energy that was put in."""
    ledger, row = rows(1.0, **now)
    assert ledger.runs_away(row) is runs_away
