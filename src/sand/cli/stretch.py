"""`sand stretch CASE.toml`: see `laboratory`."""

from .laboratory import command_of

command = command_of(
    "stretch",
    "Stretch a packing by its box, or between walls.",
    "Stretch the aggregate that CASE.toml describes along an axis, and measure its tension over the strain.",
)
