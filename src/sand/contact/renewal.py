"""The constants of existing contacts, computed anew after parameters of the contact model have changed."""

from ..basics.state import CONTACTS
from ..compiler.recipes import factory
from ..compiler.stage import Stage, stage
from .constants_table import column_loops
from .law import ContactLaw


@factory
def renewal_stage(law: ContactLaw) -> Stage:
    """The stage that computes the constants of all contacts from the present parameters, for one contact law.

    Pointers and twists, and so all displacements, are kept.
    """
    constants_of_pair, store_constants = column_loops(law).of_pair, column_loops(law).store

    @stage("the constants of contacts")
    def renew_constants(grains, contacts, count, settings):
        if count[CONTACTS] > 0:
            columns = contacts.constants.shape[1] if settings.uniform_contacts else count[CONTACTS]
            for c in range(columns):
                k = 0 if settings.uniform_contacts else c
                i, j = contacts.pair[0, k], contacts.pair[1, k]
                store_constants(contacts.constants, c, constants_of_pair(grains, settings.pairings, i, j))
        return 0

    return renew_constants
