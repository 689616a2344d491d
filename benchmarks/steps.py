"""Rows of whole steps: contacts, contacts with dipoles, gases; LAMMPS with the same grains beside them."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

import sand
from sand.basics.state import SLIPPED

from . import decks, lammps, machine, worlds
from .table import row
from .timing import Pair, fitting, in_turns, replayed

MOMENT = "10 A m^2/kg"
"""Dipoles of grains in contact: strong enough to matter, too weak to tear contacts apart."""
GRANULAR = "LAMMPS granular"
ASKED_OF_CONTACTS = 6.0
WARM_UP = 100
"""Steps before contact steps are timed: four fastest periods of a contact."""
GRAIN_STEPS = 1_000_000
"""Grains times steps of a timed piece of contact steps."""
FAR = {"every step": {2: 3.0, 20: 5.0, 100: 8.0}, "impulse": {1000: 100.0}}
"""Ratios that are asked of contacts with dipoles, by the way they act and the number of grains."""


def touched_bytes(sim: sand.Simulation) -> float:
    """Bytes of the arrays that each step reads or writes, at least: grains, and contacts but for their books."""
    w, contacts = sim.state, len(sim.contacts["pair"])
    idle = (
        "formed",
        "lost",
        "damping",
        "kept",
        "every_step",
        "start",
        "gather_order",
        *(("constants",) if w.uniform_contacts else ()),
    )
    per_contact = sum(a.nbytes / a.shape[-1] for k, a in w.contacts._asdict().items() if k not in idle)
    per_grain = sum(a.nbytes for a in w.grains.arrays) / len(w.grains)
    return contacts * per_contact + len(w.grains) * per_grain


@contextlib.contextmanager
def beside(deck: tuple[str, str]) -> Iterator[lammps.Lammps | None]:
    """LAMMPS with this deck, or None where it is not installed."""
    if not lammps.version():
        yield None
        return
    with lammps.Lammps(*deck) as program:
        yield program


def paired(sim: sand.Simulation, program: lammps.Lammps | None, quick: bool, steps: int = 0) -> Pair:
    """Seconds of a step of both, in turns; ours are the same steps each time, as many as fit if none are given."""
    ours = replayed(sim, steps or fitting(sim, 0.05 if quick else 0.15))
    rounds = 3 if quick else 5
    if program is None:
        return in_turns(ours, None, rounds)
    theirs = program.fitting(0.1 if quick else 0.3)
    return in_turns(ours, lambda: program.run(theirs).step, rounds)


def same_contacts(program: lammps.Lammps | None, contacts: int, world: str) -> None:
    """Raises RuntimeError if LAMMPS begins with another number of them."""
    if program is not None and (theirs := program.contacts()) != contacts:
        raise RuntimeError(f"{world}: {contacts} contacts, but {theirs} in LAMMPS")


def contact_step(kind: str, count: int, quick: bool, calm: bool = False) -> dict[str, Any]:
    """Everything that a step of touching grains needs: ledger, contacts that move, form and break, checks of lists.

    Contacts move beyond a limit in half of all steps while grains are shaken, hardly ever if they are `calm`.
    """
    gas = kind == "gas"
    speed = worlds.SLOW if gas or calm else worlds.SPEED
    grains = worlds.shaken(worlds.PLACES[kind](count), speed=speed)
    sim = sand.Simulation(grains, [sand.Contact()], stepping=worlds.stepping(kind))
    contacts = len(sim.contacts["pair"])
    sim.run(steps=WARM_UP)
    with beside(decks.contact_steps(grains)) as program:
        same_contacts(program, contacts, f"{kind}, {count} grains")
        steps = max(GRAIN_STEPS // count, 20) // (2 if quick else 1)
        moved, first = sim.state.count[SLIPPED], sim.state.steps
        pair = paired(sim, program, quick, steps)
    share = (sim.state.count[SLIPPED] - moved) / max(contacts, 1) / (sim.state.steps - first)
    size = touched_bytes(sim)
    asked = None if gas or count > 10_000 else ASKED_OF_CONTACTS
    return row(
        f"gas step, {count} grains" if gas else f"contact step, {kind}, {count} grains{', calm' if calm else ''}",
        pair,
        "ns per grain" if gas else "ns per contact",
        None if gas or count > 10_000 else 30.0,
        scale=1e9 / (count if gas else contacts),
        of=GRANULAR,
        ratio_asked=asked,
        note="" if gas else f"{share:.1%} of contacts moved per step",
        **machine.share_of_bandwidth(size, size, pair.ours),
    )


def damped_step(bath: str | None, quick: bool) -> dict[str, Any]:
    """Steps of a loose aggregate with dashpots on all modes, with or without thermal noise, beside undamped ones.

    The dashpots take at most a fifth of a step, with noise as long as the rest; the length of a step is the same.
    """
    grains, rounds = worlds.shaken(worlds.loose(1000), speed=worlds.SLOW), 3 if quick else 5
    contacts, runs = [sand.Contact(damping="critical", bath_temperature=bath), sand.Contact()], []
    for contact in contacts:
        sim = sand.Simulation(grains, [contact], stepping=worlds.stepping("loose"))
        sim.run(steps=WARM_UP)
        runs.append(replayed(sim, GRAIN_STEPS // 1000 // (2 if quick else 1)))
    return row(
        f"damped contacts, loose, 1000 grains{', thermal' if bath else ''}",
        in_turns(*runs, rounds),
        "ns per contact",
        scale=1e9 / len(sim.contacts["pair"]),
        of="undamped contacts",
        ratio_asked=1 / 2 if bath else 1 / 1.2,
    )


def dipole_step(quick: bool) -> dict[str, Any]:
    """Dipoles of all pairs in a whole step.

    A pair takes 81 operations (`pair_load` of `forces.pair.dipole_formulas` without its energy, and `rows_of` of
    `forces.pair.dipole_loops`):
    3 for r, 5 for r², 1/r² and √ 1 each, 2 for k/r³, 15 for three products, 2 for 3k/r⁵, 2 for the product over r²,
    1 each for a and b; the force 9 + 3 + 6, each field 9; 12 to add up two forces and two fields.
    """
    count = 300 if quick else 1000
    sim = worlds.cloud(count)
    pairs = count * (count - 1) / 2
    with beside(decks.dipoles(sim.grains)) as program:
        pair = paired(sim, program, quick)
    return row(
        f"dipole step, all pairs of {count} grains",
        pair,
        "ns per pair",
        2.3,
        scale=1e9 / pairs,
        of="LAMMPS lj/cut/dipole/cut",
        ratio_asked=10.0,
        share_asked=0.65,
        **machine.share_of_flops(81.0 * pairs, pair.ours),
    )


def together(count: int, far: str, quick: bool) -> dict[str, Any]:
    """Contacts and dipoles of a loose aggregate; LAMMPS sums dipoles in every step, and so may we."""
    grains = worlds.shaken(worlds.loose(count), MOMENT, worlds.SLOW)
    sim = sand.Simulation(grains, [sand.Contact(), sand.Dipoles()], stepping=sand.Verlet(far=far))
    contacts = len(sim.contacts["pair"])
    sim.run(steps=WARM_UP)
    with beside(decks.contacts_and_dipoles(grains)) as program:
        same_contacts(program, contacts, f"{count} grains")
        pair = paired(sim, program, quick)
    way = "" if far == "every step" else ", cycles"
    flops = 81.0 * count * (count - 1) / 2
    share = machine.share_of_flops(flops, pair.ours) if far == "every step" and count >= 100 else {}
    return row(
        f"contacts + dipoles, {count} grains{way}",
        pair,
        "us per step",
        scale=1e6,
        of="LAMMPS hybrid/overlay",
        ratio_asked=FAR[far].get(count),
        **share,
    )


def gas_step(quick: bool, count: int, target: float | None, periodic: str = "nearest image") -> dict[str, Any]:
    """Whole steps of a magnetic gas after its first contact."""
    sim = worlds.gas(count, periodic)
    while len(sim.contacts["pair"]) == 0 and sim.time < 2e-7:
        sim.run(steps=2000)
    pair = paired(sim, None, quick)
    sums = ", Ewald sum" if periodic == "ewald" else ""
    return row(f"main job's gas with contacts, {count} grains{sums}", pair, "us per step", target, scale=1e6)


def all_rows(quick: bool) -> Iterator[dict[str, Any]]:
    """Whole steps; `quick` leaves the largest worlds out."""
    counts = (1000, 10_000) if quick else (1000, 10_000, 100_000)
    for kind in worlds.PLACES:
        for count in counts:
            yield contact_step(kind, count, quick)
            if kind == "loose" and count <= 10_000:
                yield contact_step(kind, count, quick, calm=True)
    yield damped_step(None, quick)
    yield damped_step("300 K", quick)
    yield dipole_step(quick)
    for far, asked in FAR.items():
        for count in asked:
            yield together(count, far, quick)
    yield gas_step(quick, 20, 2.5)
    yield gas_step(quick, 100, 25.0)
    yield gas_step(quick, 100, None, "ewald")
