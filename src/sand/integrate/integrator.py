"""Integrators: what an integrator consists of, and the registry.

An integrator is a settings class such as `verlet.Verlet` and, if it moves grains in its own way while there are no
contacts, a stage for that.  During contacts all integrators take steps of velocity Verlet, for which forming, slip and
breaking of contacts are derived.
"""

from __future__ import annotations

from typing import Any, ClassVar, Protocol, TypeVar, runtime_checkable

from ..basics.errors import BadInput
from ..basics.grains import Grains
from ..basics.settings import Settings
from ..compiler.stage import Stage

MEMBERS = ("name", "flight", "parameters", "contact_stepping", "resolved", "flight_limits")


@runtime_checkable
class Integrator(Protocol):
    """An integrator, for `Simulation(stepping=…)`.

    Attributes
    ----------
    name : str
        `method` of the [stepping] table of case files.
    flight : Stage or None
        The stage that takes one step of grains without contacts, as in `examples/plugins/forest_ruth.py`; None for
        velocity Verlet. It takes parts of a simulation by name (`parts.PARTS`), calls the forces by `force_calls`, and
        builds on `integrate.flight`. Such steps are limited by the skin of the lists.

    A class may have two further attributes: `moves_bodies` = True, if clusters at rest move as bodies, whose steps are
    long, and `clusters`, a word that selects it in the [stepping] table instead of `method`.
    """

    name: ClassVar[str]
    flight: ClassVar[Stage | None]

    def parameters(self) -> dict[str, Any]:
        """Settings in SI units, as in a case file."""

    @property
    def contact_stepping(self) -> Any:
        """Settings of velocity Verlet while grains are in contact (`verlet.Verlet`)."""

    def resolved(self, grains: Grains, criteria: Any) -> Integrator:
        """A copy in which every "auto" is a number, from the initial grains and the `step_control.StepCriteria`."""

    def flight_limits(self, grains: Grains, longest_displacement: float) -> Any:
        """Run-time numbers and arrays of `flight`, a NamedTuple, after `resolved`.

        No step may move a grain farther than `longest_displacement` [m].
        """


class IntegratorSettings(Settings):
    """Base class of the settings of integrators, keys of the table [stepping] of case files."""

    name: ClassVar[str]
    place: ClassVar[str] = "stepping"

    def parameters(self) -> dict[str, Any]:
        """Settings in SI units, as in a case file."""
        return {"method": self.name} | super().parameters()


INTEGRATORS: dict[str, type] = {}
"""Registered integrators by name."""


def moves_bodies(stepping: Any) -> bool:
    """Whether clusters at rest move as bodies: steps are long, and contact steps are taken within them."""
    return bool(getattr(stepping, "moves_bodies", False))


def methods_of_clusters() -> dict[str, str]:
    """Words for `clusters` in the [stepping] table, and the names of the integrators that they stand for."""
    return {each.clusters: name for name, each in INTEGRATORS.items() if hasattr(each, "clusters")}


T = TypeVar("T", bound=type)


def register(integrator: T) -> T:
    """Register an integrator class, for `Simulation(stepping=…)`, case files and the tests of all integrators.

    Raises
    ------
    BadInput
        If the name is taken by another class, or a member is missing.
    """
    fields = getattr(integrator, "__dataclass_fields__", ())
    missing = [member for member in MEMBERS if not hasattr(integrator, member) and member not in fields]
    if missing:
        raise BadInput(f"integrator {integrator.__name__} lacks {', '.join(missing)}")
    name = integrator.name  # type: ignore[attr-defined]
    if INTEGRATORS.get(name, integrator) is not integrator:
        raise BadInput(f"integrator '{name}' exists already; choose another name")
    INTEGRATORS[name] = integrator
    return integrator
