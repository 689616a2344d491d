"""A registry of units of pint, as a user has one; making one takes a third of a second."""

import pint

UNIT = pint.UnitRegistry()
