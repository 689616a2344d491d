"""Bodies from files, for the tests of readers and exports."""

from sand.io.read_grains import centred, read_grains


def read_body(path, *arguments, **named):
    """The grains of a file with the centre of mass at the origin; parameters as for `read_grains`."""
    return centred(read_grains(path, *arguments, **named).grains)
