"""`sand compress CASE.toml`: see `laboratory`."""

from .laboratory import command_of

command = command_of(
    "compress",
    "Compress a packing in a box that shrinks, or between walls.",
    "Compress the aggregate that CASE.toml describes, and measure its pressure over the filling factor.",
)
