"""Notes on growth runs whose contacts vibrate far above the temperature of the grains."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..constants import BOLTZMANN
from ..units import format_quantity

HOT = 100.0
"""Internal kinetic energy per grain, in k_B T of the grains at the start, from which a run says so."""


def vibration_notes(rows: Sequence[dict[str, Any]], temperature: float, grains: int, *, damped: bool) -> dict[str, str]:
    """What the ledger says about vibrations of contacts in a run that began with free grains, by the kind of finding.

    Collisions of aggregates, in which contacts are meant to vibrate and to break, have no notes.

    Parameters
    ----------
    rows : Sequence[dict[str, Any]]
        Rows of the ledger.
    temperature : float
        Temperature T₀ of the grains at the start [K]; at 0 nothing is compared with it.
    grains : int
        Number of grains.
    damped : bool
        Whether contacts are damped, for the advice.

    Returns
    -------
    dict of str to str
        "vibration": internal kinetic energy above 100 k_B T₀ per grain; "breaking": contacts that broke.
    """
    notes: dict[str, str] = {}
    if not rows or rows[0]["clusters"] < grains:
        return notes
    share = grains * BOLTZMANN * temperature
    advice = "damping = 'critical' in [forces.contact] (sand.Contact) removes the vibrations that every touch leaves"
    if damped:
        advice = "contacts are damped already: fast impacts cause this, or the damping is too weak"
    if share > 0.0 and (hot := next((row for row in rows if row["internal"] > HOT * share), None)) is not None:
        most = max(row["internal"] for row in rows) / share
        notes["vibration"] = (
            f"grains in contact vibrate: from {format_quantity(hot['time'], 's')} on their internal kinetic energy "
            f"exceeds {HOT:g} k_B T₀ per grain, {most:.3g} at most; {advice}"
        )
    if broken := rows[-1]["broken"]:
        notes["breaking"] = f"{broken} contact{'s' * (broken > 1)} of growing aggregates broke; {advice}"
    return notes
