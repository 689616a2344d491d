"""`sand shear CASE.toml`: see `laboratory`."""

from .laboratory import command_of

command = command_of(
    "shear",
    "Shear a packing, by its box or between two walls.",
    "Shear the aggregate that CASE.toml describes, and measure its shear stress over the strain.",
)
