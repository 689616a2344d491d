"""Ground of all packages: units, constants, checks of arguments, materials, box, grains, and the state as arrays.  Nothing here is compiled."""
