"""Contact update: the pass over all contacts against updating each flagged contact separately."""

import copy

import numpy as np
import pytest

from sand.basics.arrays import empty_contact_arrays, empty_pair_list
from sand.basics.box import Box
from sand.basics.grains import GrainArrays, Grains
from sand.basics.material import SILICA
from sand.basics.state import BROKEN, CLOCK, CONTACTS, COUNT, LOST, ROLLING, SLIDING, SLIPPED, STEPS, TWISTING
from sand.basics.state import STEP as STEP_LENGTH
from sand.contact.constants_table import column_loops, constant_names
from sand.contact.damping import NONE
from sand.contact.events import slip_and_break_loop
from sand.contact.jkr import LAW as JKR
from sand.contact.law import contact_constants
from sand.contact.mechanics import displacements_of, exceeds_limits
from sand.contact.model import Contact
from sand.contact.poses import displacements_before, pose_at, twist_increment
from sand.contact.slip_rules import ROLL, STEP_KEPT
from sand.contact.tangential import pointers_for
from sand.contact.transitions import BROKEN_FLAG, PENDING_FLAG, SLID_FLAG, SLIPPED_FLAG
from sand.contact.update import ContactSums, PassVariant, PresentStep, log_contact_sums, single_contact_loop
from sand.integrate.motion import drift_for
from sand.integrate.parts import ContactParameters
from sand.integrate.stages import StageNumber, contact_event_stages, contact_pass_stage
from sand.integrate.task_queue import new_task_queue
from sand.numerics.quaternion import turned_back
from sand.numerics.vec import axpy, load4, put, scale

from ...tables import table_of

PAIRS = 403
"""Contacts of a test: several full blocks, and a remainder that is no full SIMD vector."""
STEP = 1e-11
STATE = ("pointer1", "pointer2", "twist", "force", "torque1", "torque2", "lost")
OPEN, PERIODIC = PassVariant(periodic=False, adhesive=True), PassVariant(adhesive=True)
FOLLOWING, HERTZIAN = PassVariant(periodic=False, follow=True, adhesive=True), PassVariant(periodic=False)
update_flagged_contacts, write_loads = slip_and_break_loop(JKR, NONE), single_contact_loop(JKR)
columns = column_loops(JKR)


def pass_and_update(variant):
    """A pass in the given variant and the update of the contacts that it has left, by the stages of runs."""
    contact_pass = contact_pass_stage(JKR, variant, variant in (OPEN, PERIODIC))
    update = contact_event_stages(JKR, NONE)[StageNumber.SLIP_AND_BREAK]

    def run(grains, contacts, near, count, lost, span, law, dt):
        clock, queue, pending = np.zeros(len(CLOCK)), new_task_queue(2 * PAIRS, PAIRS), 0
        clock[STEP_LENGTH] = dt
        given = {"clock": clock, "count": count, "lost": lost, "span": span, "settings": law, "queue": queue}
        table = table_of(grains=grains, contacts=contacts, pair_list=near, **given)
        for block in range(len(queue.passed)):
            contact_pass.run(table, (), block)
            passed = ContactSums(*queue.passed[block, : len(ContactSums._fields)])
            log_contact_sums(count, lost, passed)
            pending += passed.pending
        update.run(table)
        return pending

    return run


def update_each(grains, contacts, near, count, lost, span, law, dt):
    """Reference: the twist and the loads of each contact by the formulas for one contact, limits one by one.

    Contacts are in a periodic box, with or without adhesion, for all that these formulas know.
    """
    for c in range(PAIRS):
        constants, (i, j) = columns.at(contacts, c), contacts.pair[:, c]
        pose = pose_at(grains, contacts, span, c, 0.0)
        contacts.twist[c] += twist_increment(grains, contacts, c, pose, PresentStep(span, law, 0, dt))
        pose = pose_at(grains, contacts, span, c, contacts.twist[c])
        r1, r2 = grains.radius[i], grains.radius[j]
        found = displacements_of(pose, r1 + r2 - pose.distance, r1, r2, constants)
        beyond = exceeds_limits(found, pose.n, constants) or not JKR.fast_radius_root(found.overlap, constants)[1]
        contacts.flag[c] = PENDING_FLAG if beyond else 0
        write_loads(grains, contacts, span, law, c)
    update_flagged_contacts(grains, contacts, near, count, lost, PresentStep(span, law, 0, dt))


def random_contacts(material, box, seed=1):
    """Pairs of grains in a box with displacements below and above each limit, breaking included."""
    rng = np.random.default_rng(seed)

    def vectors(size):
        v = rng.normal(size=(PAIRS, 3))
        return size * v / np.linalg.norm(v, axis=1)[:, None]

    pairing = Contact().pairing(material, material)
    r1, r2 = rng.uniform(5e-9, 2e-8, (2, PAIRS))
    mass = 4 / 3 * np.pi * 2000.0 * np.array([r1, r2]) ** 3
    n, contacts = vectors(1.0), empty_contact_arrays(2 * PAIRS, PAIRS, len(constant_names(JKR)))
    grains = GrainArrays(*(np.zeros_like(a) for a in Grains(np.zeros((2 * PAIRS, 3)), 1e-8, material).arrays))
    grains.orientation[:] = rng.normal(size=(4, 2 * PAIRS))
    grains.orientation[:] /= np.linalg.norm(grains.orientation, axis=0)
    grains.radius[:], grains.mass[:] = np.concatenate((r1, r2)), mass.ravel()
    grains.velocity[:] = rng.normal(size=(3, 2 * PAIRS))
    grains.spin[:] = 1e8 * rng.normal(size=(3, 2 * PAIRS))
    contacts.flag[:PAIRS] = 1.0  # all slipped in the previous step
    contacts.lost[:] = rng.uniform(0.0, 1e-20, contacts.lost.shape)
    for c in range(PAIRS):
        constants = contact_constants(JKR)(pairing, r1[c], r2[c], *mass[:, c])
        across = [np.cross(n[c], v) for v in vectors(1.0)[:2]]
        slide, roll, twist = rng.uniform(0.0, 1.6, 3)
        slide, roll = scale(slide * constants.slide_limit, across[0]), scale(roll * constants.roll_limit, across[1])
        n1, n2 = pointers_for(slide, roll, n[c], r1[c], r2[c])
        overlap_factor = rng.uniform(-1.1, 2.0) if c % 10 else rng.uniform(5.0, 20.0)
        centre = rng.uniform(-1e-7, 1e-7, 3)
        apart = (
            r1[c]
            + r2[c]
            - overlap_factor * constants.normal.pull_off_overlap * (0.2 if constants.normal.hertz > 0.0 else 1.0)
        )
        put(grains.position, c, axpy(0.5 * apart, n[c], centre))
        put(grains.position, c + PAIRS, axpy(-0.5 * apart, n[c], centre))
        put(contacts.pointer1, c, turned_back(load4(grains.orientation, c), n1))
        put(contacts.pointer2, c, turned_back(load4(grains.orientation, c + PAIRS), n2))
        contacts.pair[:, c] = c, c + PAIRS
        contacts.twist[c] = twist * constants.twist_limit * rng.choice((-1.0, 1.0))
        columns.store(contacts.constants, c, constants)
    grains.position[:] = box.wrap(grains.position.T).T
    count = np.zeros(len(COUNT), np.int64)
    count[CONTACTS] = PAIRS
    return grains, contacts, empty_pair_list(2 * PAIRS, 16), count, np.zeros(len(LOST))


def parameters_for(reset=False, follow=False):
    return ContactParameters(True, np.zeros((11, 1, 1)), reset, follow, False, 0.0, 0, 25.0)


OPTIONS = {
    "clamped": (SILICA, Box.open(), parameters_for(), OPEN),
    "reset": (SILICA, Box.open(), parameters_for(reset=True), OPEN),
    "rolling": (SILICA, Box.open(), parameters_for(), OPEN),
    "periodic": (SILICA, Box.periodic(2.2e-7, None, 3e-7), parameters_for(), PERIODIC),
    "following": (SILICA, Box.open(), parameters_for(follow=True), FOLLOWING),
    "hertzian": (SILICA.but(name="dry", surface_energy=0.0), Box.open(), parameters_for(), HERTZIAN),
}


@pytest.mark.compiled("small")
@pytest.mark.parametrize("option", OPTIONS)
def test_pass_and_separate_update_agree(option):
    """Same pointers, twists, loads and losses as of each contact alone, to 1e-12 of the largest value of each array.

    Pointers have errors of 1e-16 and displacements are 1e-3 of a radius, so forces and energies are known to 1e-13.
    """
    material, box, law, variant = OPTIONS[option]
    system = random_contacts(material, box)
    if option == "rolling":
        system[1].flag[:PAIRS] = SLIPPED_FLAG  # in the step before, in rolling only
    other = copy.deepcopy(system)
    pending = pass_and_update(variant)(*system, box.span, law, STEP)
    update_each(*other, box.span, law, STEP)
    contacts, expected = system[1], other[1]
    for name in STATE:
        a, b = getattr(contacts, name)[..., :PAIRS], getattr(expected, name)[..., :PAIRS]
        assert np.abs(a - b).max() <= 1e-12 * np.abs(b).max(), name
    assert (system[3] == other[3]).all()
    np.testing.assert_allclose(system[4], other[4], rtol=1e-12, atol=1e-12 * np.abs(other[4]).max())
    flag, expected_flag = contacts.flag[:PAIRS], expected.flag[:PAIRS]
    assert ((flag == BROKEN_FLAG) == (expected_flag == BROKEN_FLAG)).all() and ((flag > 0) == (expected_flag > 0)).all()
    # all kinds of transitions occur, and the pass updates slipping contacts except those it must leave pending
    assert 0 < system[3][BROKEN] < PAIRS / 2 and np.sum(flag == 0.0) > PAIRS / 10
    if option in ("clamped", "reset", "periodic"):
        slid, rolled = np.sum(flag == SLID_FLAG), np.sum(flag == SLIPPED_FLAG)
        assert slid > PAIRS / 4 and rolled > 0 and np.sum(flag == PENDING_FLAG) > 0
        assert system[3][BROKEN] < pending < PAIRS / 3
        assert system[3][SLIPPED] >= slid + rolled
        assert (system[4][[SLIDING, ROLLING, TWISTING]] != 0.0).all()
    if option == "rolling":  # others are left to the update of each contact
        assert 0 < np.sum(flag == SLIPPED_FLAG) < PAIRS / 4 and not np.any(flag == SLID_FLAG)
        assert pending > PAIRS / 2 and (system[4][[SLIDING, ROLLING, TWISTING]] != 0.0).all()
    if option == "following":
        assert not np.any(flag >= SLIPPED_FLAG)


@pytest.mark.compiled("small")
@pytest.mark.parametrize("rule", [SLID_FLAG, SLIPPED_FLAG], ids=["all modes", "rolling"])
def test_kept_displacements_are_those_at_the_start_of_the_next_step(rule):
    """Losses of a second step with the displacements that the first one kept, and with none, agree to rounding.

    Displacements of 1e-3 radii have errors of 1e-13 of their size, and the losses those of the displacements: they
    agree to 1e-11 of the largest. Contacts that the first step has left to single updates have nothing that is kept;
    wrong displacements change the losses.
    """
    span, system = Box.open().span, random_contacts(SILICA, Box.open())
    grains, contacts, _, count, _ = system
    contacts.flag[:PAIRS] = rule
    empty = copy.deepcopy(system)
    pass_and_update(OPEN)(*empty, span, parameters_for(), 0.0)  # has the number of the step that follows
    assert not empty[1].kept[STEP_KEPT, :PAIRS].any()
    pass_and_update(OPEN)(*system, span, parameters_for(), STEP)
    single = np.isin(contacts.flag[:PAIRS], (PENDING_FLAG, BROKEN_FLAG))
    assert (contacts.kept[STEP_KEPT, :PAIRS] > 0.0).tolist() == (~single).tolist() and np.any(single)
    contacts.flag[:PAIRS] = rule
    count[STEPS], grains.inertia[:] = 1, 1.0
    drift_for(False)(grains, np.uint64(0), np.uint64(2 * PAIRS), span, STEP)
    contacts.lost[:] = 0.0
    none, wrong = copy.deepcopy(system), copy.deepcopy(system)
    none[1].kept[STEP_KEPT] = 0.0
    wrong[1].kept[ROLL] *= 1.01
    for each in (system, none, wrong):
        pass_and_update(OPEN)(*each, span, parameters_for(), STEP)
    lost, expected, other = (each[1].lost[:, :PAIRS] for each in (system, none, wrong))
    largest = np.abs(expected).max(axis=1, keepdims=True)
    assert (np.abs(lost - expected) <= 1e-11 * largest).all() and (np.abs(other - expected) > 1e-5 * largest).any()


def test_displacements_before_a_step():
    """Displacements at the start of a step equal those of grains that drift back, to 1e-12 of the largest."""
    grains, contacts, *_ = random_contacts(SILICA, Box.periodic(2.2e-7, None, 3e-7))
    span = Box.periodic(2.2e-7, None, 3e-7).span
    back, step = copy.deepcopy(grains), PresentStep(span, parameters_for(), 0, STEP)
    back.inertia[:] = 1.0
    drift_for(False)(back, np.uint64(0), np.uint64(2 * PAIRS), span, -STEP)  # no forces act
    found, expected = [], []
    for c in range(PAIRS):
        constants, radii = columns.load(contacts.constants, c), (grains.radius[c], grains.radius[c + PAIRS])
        pose = pose_at(grains, contacts, span, c, contacts.twist[c])
        found.append(np.hstack(displacements_before(grains, contacts, c, pose, constants, step)))
        twist = contacts.twist[c] - twist_increment(grains, contacts, c, pose, step)
        then = pose_at(back, contacts, span, c, twist)
        expected.append(np.hstack(displacements_of(then, sum(radii) - then.distance, *radii, constants)))
    found, expected = np.array(found), np.array(expected)
    assert (np.abs(found - expected).max(0) <= 1e-12 * np.abs(expected).max(0)).all()


@pytest.mark.compiled("small")
def test_contacts_that_do_not_slip_are_unchanged():
    """Pointers and losses of contacts that do not slip stay the same bit by bit, whatever others in a block do."""
    system = random_contacts(SILICA, Box.open(), seed=2)
    before = copy.deepcopy(system[1])
    pass_and_update(OPEN)(*system, Box.open().span, parameters_for(), STEP)
    at_rest = system[1].flag[:PAIRS] == 0.0
    for name in ("pointer1", "pointer2", "lost"):
        assert (getattr(system[1], name)[:, :PAIRS][:, at_rest] == getattr(before, name)[:, :PAIRS][:, at_rest]).all()


@pytest.mark.compiled("small")
def test_blocks_without_slip_leave_contacts_pending():
    """If no contact slipped in the previous step, the pass only flags; contacts are updated separately."""
    system = random_contacts(SILICA, Box.open())
    system[1].flag[:] = 0.0
    pending = pass_and_update(OPEN)(*system, Box.open().span, parameters_for(), STEP)
    assert pending > PAIRS / 2 and not np.any(system[1].flag >= SLIPPED_FLAG)
    assert system[3][SLIPPED] > PAIRS / 2
