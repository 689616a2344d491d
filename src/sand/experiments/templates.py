"""Case files with every key, for each command that reads one; see `config.template`."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from ..config.case import RunSection
from ..config.template import (
    EXAMPLES,
    MAGNETIC,
    REQUIRED,
    Key,
    Table,
    Values,
    force_tables,
    keys_of,
    material_table,
    run_tables,
    stepping_table,
    summary,
    template,
)
from ..forces.registry import FORCES
from ..setup.grain_classes import GrainClass
from .collision_case import BodySection, ImpactSection
from .dilute_case import NOT_OF_GRAINS, NOT_OF_RUN, MethodSection
from .growth_case import GrowSection
from .laboratory_case import CASES, OF_COMMAND, PackingSection
from .scattering.scatter_case import FlightSection, MeasureSection, ScatterBody
from .sweep_design import SweepSection
from .sweep_population import DiluteGrains

BODY = {"kind": "bpca", "grains": 16, "radius": "0.1 um", "material": "silica"}
COLLISION: Values = {
    "target": BODY,
    "projectile": BODY,
    "impact": {"speed": "1 m/s", "impact_parameter": "0.3 b", "seeds": [1]},
    "forces.contact": {"damping": "viscoelastic", "viscous_time": "1.25e-11 s"},
}
"""Keys in use of `sand collide`: two fluffy aggregates of silica."""
SCATTERING: Values = {
    "projectile": {"radius": "10 nm", "material": "iron", "moment": "200 A m^2/kg"},
    "flight": {"temperature": "100 K", "speed": ["0.5 m/s", "2 m/s"]},
    "measure": {"relative_error": 0.05, "seed": 1},
}
"""Keys in use of `sand scatter`: cross-sections of two magnetic grains of iron at two speeds."""
GROWTH: Values = {**EXAMPLES, "grow": {"seeds": [1, 2, 3, 4]}, "run": {"until": "20 us", "frame_every": "0.1 us"}}
"""Keys in use of `sand grow`: the gas of the case of `sand run`, for four seeds."""
DILUTE: Values = {
    "method": {"kind": "encounters", "hits": "resolve"},
    "run": {"stop": "mean_cluster_size >= 10"},
    "grow": {"seeds": [1, 2]},
    "grains": {
        "kind": "gas",
        "number": 500,
        "number_density": "3e8 /m^3",
        "radius": "10 nm",
        "material": "iron",
        "moment": "200 A m^2/kg",
        "temperature": "100 K",
    },
    "forces.contact": {"damping": "critical", "damping_ratio": 0.2, "settling_time": "5 ns"},
    "forces.dipoles": {"cutoff": "auto"},
}
"""Keys in use of `sand grow` with encounters: magnetic grains of iron, 10 au from the Sun, for two seeds."""
DILUTE_FORCES = {
    "contact": None,
    "dipoles": ("cutoff",),
    "charges": ("cutoff",),
    "field": ("flux_density",),
    "gas": None,
}
"""Forces that encounters have, and which of their keys; None: all."""
DAMPED = {"damping": "constant", "damping_constant": "2.2e-10 kg/s"}
PACKED = {"kind": "rbd", "grains": 64, "radius": "0.1 um", "material": "ice"}
LOADINGS: dict[str, Values] = {
    "compress": {
        "aggregate": {"kind": "bcca", "grains": 64, "radius": "0.1 um", "material": "ice"},
        "compression": {"rate": "3e-5 /t_c", "to": 0.2, "seeds": [1, 2]},
        "forces.contact": DAMPED,
    },
    "stretch": {
        "aggregate": PACKED,
        "stretch": {"rate": "1e-4 /t_c", "to": 0.5, "by": "walls", "seeds": [1, 2]},
        "forces.contact": DAMPED,
    },
    "shear": {
        "aggregate": PACKED,
        "shear": {"rate": "1e-4 /t_c", "to": 1.0, "by": "walls", "seeds": [1, 2]},
        "forces.contact": DAMPED,
    },
    "elastic": {
        "aggregate": {"kind": "bcca", "grains": 64, "radius": "0.1 um", "material": "ice"},
        "elastic": {"strains": [1e-6, 1e-4], "compress_to": 0.3, "copies": 3, "seeds": [1]},
        "forces.contact": DAMPED,
    },
}
"""Keys in use of `sand compress`, `stretch`, `shear` and `elastic`: aggregates of ice, slightly damped."""
SWEEP = {"vary": {"impact.speed": "log(0.3 m/s, 3 m/s, 4)", "impact.impact_parameter": ["0 b", "0.5 b"]}, "seeds": 2}
"""Keys in use of [sweep], for the collisions above."""


def _collision(name: str) -> str:
    return template(name, "collide", _collision_tables(), COLLISION)


def _sweep(name: str) -> str:
    note = summary(SweepSection).removeprefix("Section [sweep]: ").capitalize()
    sweep = Table("[sweep]", note, keys_of(SweepSection))
    return template(name, "sweep", [sweep, *_collision_tables()], {"sweep": SWEEP, **COLLISION})


def _collision_tables() -> list[Table]:
    note = "A grain or an aggregate; a different one for each seed if it is random, or a file."
    return [
        Table("[target]", note, keys_of(BodySection)),
        Table("[projectile]", note, keys_of(BodySection)),
        Table(
            "[impact]", summary(ImpactSection).removeprefix("Section [impact]: ").capitalize(), keys_of(ImpactSection)
        ),
        material_table(),
        *force_tables(),
        stepping_table(),
    ]


def _scattering(name: str) -> str:
    tables = [
        Table("[projectile]", "The body that flies: a grain, or an aggregate.", keys_of(ScatterBody)),
        Table("[target]", "The body that it meets; without this table, one like the projectile.", keys_of(ScatterBody)),
        Table("[flight]", "Initial conditions.", _flight_keys()),
        Table("[measure]", "What to compute, and how accurately.", keys_of(MeasureSection)),
        material_table(),
    ]
    return template(name, "scatter", tables, SCATTERING)


def _loading(name: str, command: str) -> str:
    table = OF_COMMAND[command]
    section: Any = CASES[command].model_fields[table].annotation
    note = summary(section).removeprefix(f"Section [{table}]: ").capitalize()
    tables = [
        Table("[aggregate]", summary(PackingSection).removeprefix("Section [aggregate]: "), keys_of(PackingSection)),
        Table(f"[{table}]", note, keys_of(section)),
        material_table(),
        *force_tables(),
        stepping_table(),
    ]
    return template(name, command, tables, LOADINGS[command])


def _flight_keys() -> list[Key]:
    """Keys of [flight], of which the speed is required."""
    return [key._replace(default=REQUIRED) if key.name == "speed" else key for key in keys_of(FlightSection)]


def _growth(name: str) -> str:
    grow = Table("[grow]", "One box for each seed, all alike otherwise.", keys_of(GrowSection))
    run, *others = run_tables()
    # all boxes end at the same time, and each has its own seed and folder
    kept = [key for key in run.keys if key.name not in ("stop", "seed", "out")]
    return template(name, "grow", [grow, run._replace(keys=kept), *others], GROWTH)


def _encounters(name: str) -> str:
    """Case of `sand grow` with encounters, which has no box and chooses its steps."""
    left = {"run": {*NOT_OF_RUN, "seed"}, "grains": {*NOT_OF_GRAINS, "classes"}}
    sections = {"run": RunSection, "grow": GrowSection, "grains": DiluteGrains}
    notes = {"grow": "One population for each seed, all alike otherwise."}
    method = Table(
        "[method]", summary(MethodSection).removeprefix("Section [method] of `sand grow`: "), keys_of(MethodSection)
    )
    tables = [
        Table(f"[{table}]", notes.get(table, ""), [key for key in keys_of(kind) if key.name not in left.get(table, ())])
        for table, kind in sections.items()
    ]
    forces = [
        Table(
            f"[forces.{force}]",
            summary(FORCES[force]),
            [key for key in keys_of(FORCES[force]) if own is None or key.name in own],
        )
        for force, own in DILUTE_FORCES.items()
    ]
    classes = Table("[[grains.classes]]", summary(GrainClass), keys_of(GrainClass))
    return template(name, "grow", [method, *tables, classes, material_table(), *forces], DILUTE)


TEMPLATES: dict[str, Callable[[str], str]] = {
    "run": template,
    "magnetic": partial(template, used=MAGNETIC),
    "collide": _collision,
    "scatter": _scattering,
    "grow": _growth,
    "encounters": _encounters,
    **{command: partial(_loading, command=command) for command in LOADINGS},
    "sweep": _sweep,
}
"""Text of a case file, from its name, by command, or by kind of cases of one."""
