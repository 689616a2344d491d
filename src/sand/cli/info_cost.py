"""What `sand info` says of the expected cost of a case, and of the limits of the model."""

from __future__ import annotations

from typing import Any

from . import report


def cost_of(
    simulation: Any, end: float, last_step: float, condition: str | None, runs: int = 1, figures: int = 1
) -> tuple[dict[str, Any], report.Rows]:
    """Expected cost of a run, or of several like it one after the other, which draw one figure or one each."""
    cost, missing = simulation.expected_cost(end, last_step, condition), simulation._engine.uncompiled()
    if cost.seconds is not None:
        parts = {name: (figures if name == "start" else runs) * value for name, value in cost.parts.items()}
        # collisions of many seeds keep no files
        disk = runs * cost.disk if figures == runs and cost.disk is not None else None
        cost = cost._replace(parts=parts, seconds=sum(parts.values()), disk=disk)
    compilation, names = sum(missing.values()), list(missing)
    stages = f"{', '.join(names[:3])}{f' and {len(names) - 3} more' if len(names) > 3 else ''}"
    rows = [
        ("steps", _steps(cost)),
        ("wall time", _wall_time(cost)),
        ("memory", f"about {report.format_bytes(cost.memory)}"),
        *([] if cost.disk is None else [("disk", f"about {report.format_bytes(cost.disk)}")]),
        ("compilation", f"about {compilation:.0f} s of one core, once: {stages}" if missing else "none"),
    ]
    content = {**cost._asdict(), "measured": bool(cost.measured), "compiled": names}
    return content | {"compilation_seconds": compilation}, rows


def of_each(costs: report.Rows, number: int, name: str) -> report.Rows:
    """Rows of the cost of several runs: the steps are those of one of them, the wall time that of all by one worker."""
    if number == 1:
        return costs
    texts = dict(costs)
    texts["steps"] += f", in each {name}"
    texts["wall time"] += f"; all {number} by one worker"
    return list(texts.items())


def _steps(cost: Any) -> str:
    """Expected steps, for people."""
    from ..basics.units import format_quantity

    each = f"about {format_quantity(float(f'{cost.step:.2g}'), 's')} each"
    if cost.steps is None:
        return each
    number = f"{cost.bound or 'about'} {cost.steps:.2g}"
    if cost.contact_steps is None:
        return f"{number}, {each}"
    return f"{number} of bodies, {each}, and about {cost.contact_steps:.2g} contact steps of awake clusters"


def _wall_time(cost: Any) -> str:
    """Expected wall time and its parts, for people."""
    if cost.seconds is None:
        return "depends on the condition"
    stepping, output, start = (report.format_wall_time(float(f"{v:.2g}")) for v in cost.parts.values())
    total = report.format_wall_time(float(f"{cost.seconds:.2g}"))
    source = f"speed {cost.measured}" if cost.measured else "rough estimate: no run was measured on this machine"
    return f"{cost.bound or 'about'} {total}: steps {stepping}, output {output}, start and figure {start} ({source})"


def limits_of(simulation: Any) -> dict[str, str]:
    """Limits of the model for the grains and forces of a simulation, by label."""
    from ..limits.model_limits import limit_rows

    return limit_rows(simulation.grains, simulation.forces, simulation.box)
