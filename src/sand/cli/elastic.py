"""`sand elastic CASE.toml`: see `laboratory`."""

from .laboratory import command_of

command = command_of(
    "elastic",
    "Measure elastic moduli and the speed of sound of a packing at rest.",
    "Bring the packing that CASE.toml describes to rest in its periodic box, strain the box slightly, and send pulses "
    "through the packing: elastic moduli and speed of sound.",
    ("elastic_job", "ElasticJob"),
    "Computes each seed, and writes",
)
