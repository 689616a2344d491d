"""Integrators: what an integrator consists of, and the registry.

An integrator is a settings class such as `verlet.Verlet` and, if it moves grains in its own way while there are no
contacts, a stage for that.  During contacts all integrators take steps of velocity Verlet, for which forming, slip and
breaking of contacts are derived.
"""

from __future__ import annotations

from typing import Any, ClassVar, Protocol, TypeVar, runtime_checkable

from ..basics.grains import Grains
from ..compiler.stage import Stage
from ..errors import BadInput

MEMBERS = ("name", "flight", "parameters", "contact_stepping", "resolved", "flight_limits")


@runtime_checkable
class Integrator(Protocol):
    """An integrator, for `Simulation(stepping=…)`.

    Attributes
    ----------
    name : str
        `method` of the [stepping] table of case files.
    flight : Stage or None
        The stage that takes one step of grains without contacts, such as `forest_ruth.symplectic_flight`; None for
        velocity Verlet. It takes parts of a simulation by name (`parts.PARTS`) and calls the forces by `force_calls`.
        Such steps are limited by the skin of the lists.
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

    def flight_limits(self, longest_displacement: float) -> Any:
        """Run-time numbers of `flight`, after `resolved`; no step may move a grain farther than this [m]."""


INTEGRATORS: dict[str, type] = {}
"""Registered integrators by name."""

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
