"""Ground of all packages: errors, units, checks of arguments, settings, materials, box, grains, the state as arrays.

Nothing here is compiled.
"""
