"""Notes on growth runs whose contacts vibrate far above the temperature of the grains."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..basics.constants import BOLTZMANN
from ..basics.units import format_quantity
from ..contact.model import DAMPED_SPEED_GAIN, DEFAULT_DAMPING_RATIO

HOT = 100.0
"""Internal kinetic energy per grain, in k_B T of the grains at the start, from which a run says so."""
GROWN = 3
"""Grains of the largest cluster from which on aggregates grow; two grains that touch are a collision."""


def vibration_notes(rows: Sequence[dict[str, Any]], temperature: float, grains: int, *, damped: bool) -> dict[str, str]:
    """What the ledger says about vibrations of contacts where aggregates have grown from free grains, by the finding.

    Collisions of two grains or of aggregates, in which contacts are meant to vibrate and to break, have no notes: their
    thresholds are those of the undamped contact, and damping would move them. So damping is advised only where a
    cluster of `GROWN` grains or more has formed in the run and contacts vibrate.

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
        "vibration": internal kinetic energy above 100 k_B T₀ per grain; "breaking": contacts that broke, with advice
        where contacts vibrate or are damped.
    """
    notes: dict[str, str] = {}
    if not rows or rows[0]["clusters"] < grains:
        return notes
    grown = [row for row in rows if row["largest_cluster"] >= GROWN]
    share = grains * BOLTZMANN * temperature
    hot = [row for row in grown if row["internal"] > HOT * share]
    advice = (
        "; damping = 'critical' in [forces.contact] (sand.Contact) removes the vibrations that every touch leaves, but "
        f"grains then stick up to {DAMPED_SPEED_GAIN:g} times the speed (damping_ratio = {DEFAULT_DAMPING_RATIO:g})"
    )
    if damped:
        advice = "; contacts are damped already: fast impacts cause this, or the damping is too weak"
    if hot and share > 0.0:
        most = max(row["internal"] for row in grown) / share
        notes["vibration"] = (
            f"grains in contact vibrate: kinetic energy within clusters, up to {most:.3g} k_B T₀ per grain, above "
            f"{HOT:g} first at t = {format_quantity(hot[0]['time'], 's')}; T₀ is the temperature at the start{advice}"
        )
    if grown and (broken := rows[-1]["broken"]):
        cause = advice if damped or hot else ""
        notes["breaking"] = f"{broken} contact{'s' * (broken > 1)} broke while aggregates grew{cause}"
    return notes
