"""Memory that this process may still use."""

from __future__ import annotations

from pathlib import Path

__all__ = ["free_memory"]


def free_memory(system: Path = Path("/")) -> float | None:
    """Memory [bytes] that is free on this machine, and below the limits of a container or batch job; None if not known.

    Parameters
    ----------
    system : Path, optional
        Root of the files in which Linux tells it.
    """
    free = []
    for line in _lines(system / "proc/meminfo"):
        if line.startswith("MemAvailable:"):
            free.append(1024.0 * float(line.split()[1]))
    for line in _lines(system / "proc/self/cgroup"):
        _, controllers, place = line.split(":", 2)
        if not controllers or "memory" in controllers.split(","):
            top = system / "sys/fs/cgroup" / ("memory" if controllers else "")
            group = top / place.lstrip("/")
            free += [left for each in (group, *group.parents) if each.is_relative_to(top) for left in _left(each)]
    return max(min(free), 0.0) if free else None


def _left(group: Path) -> list[float]:
    """What the limit of one control group leaves [bytes], of version 2 or 1; nothing without a limit."""
    for limit, used in (("memory.max", "memory.current"), ("memory.limit_in_bytes", "memory.usage_in_bytes")):
        words = [*_lines(group / limit)[:1], *_lines(group / used)[:1]]
        if len(words) == 2 and words[0] != "max":
            cache = [line.split()[1] for line in _lines(group / "memory.stat") if line.startswith("inactive_file ")]
            return [float(words[0]) - float(words[1]) + float(cache[0] if cache else 0.0)]
    return []


def _lines(path: Path) -> list[str]:
    try:
        return path.read_text("utf-8").splitlines()
    except OSError:
        return []
