"""Engines of few grains in open space, one for each number of grains, which are filled with other grains again."""

from __future__ import annotations

import math

import numpy as np

from ..basics.grains import GrainArrays
from ..basics.initial_pairs import StrainedContacts
from ..contact.model import Contact
from ..integrate.part_copies import begin_part
from .engine import Engine
from .initial_contacts import add_contacts
from .part import MOST_ENGINES, engine_of_part
from .rigid.awake_steps import ClusterMeasures, cluster_measures, measure_clusters_stage


class FewGrains:
    """Engines like a prototype for grains like those of it; building one costs more than most hits.

    Parameters
    ----------
    prototype : Engine
        An engine of grains with all radii, masses, materials and moments that occur.
    contact : Contact
        The contact model among its forces.
    """

    def __init__(self, prototype: Engine, contact: Contact):
        self.prototype, self.contact = prototype, contact
        self._engines: dict[int, Engine] = {}

    def fill(self, grains: GrainArrays, contacts: StrainedContacts) -> Engine:
        """The engine of as many grains, at a start with these grains and contacts, and with the first loads.

        Raises BadInput if a contact is stretched beyond its breaking point.
        """
        count, known = grains.mass.size, self.prototype.regular_state
        engine = self._engines.get(count)
        arrays = grains._replace(id=np.arange(count, dtype=np.uint32))
        if engine is None:
            if len(self._engines) == MOST_ENGINES:
                self._engines.clear()
            own = known.grains.with_arrays(GrainArrays(*map(np.copy, arrays)))
            engine = self._engines[count] = engine_of_part(self.prototype, own, known, count + len(contacts.pair))
        state = engine.regular_state
        for array, values in zip(state.grains.arrays, arrays, strict=True):
            array[...] = values
        begin_part.run(engine.table_of(state), (np.zeros(4),))
        add_contacts(engine, self.contact, contacts)
        engine.begin()
        return engine


def measured_clusters(engine: Engine) -> ClusterMeasures:
    """Size, vibration, period and limits of each cluster of the state, see `ClusterMeasures`; used again."""
    measures: ClusterMeasures = engine.memory_for("clusters", cluster_measures)
    measures.limits[:] = math.inf, 0.0  # the caller has an own limit of vibrations
    measure_clusters_stage(engine.law).run(engine.table_of(engine.regular_state), measures)
    return measures
