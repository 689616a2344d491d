"""Collision models for growth codes, from a table of collisions: growth efficiency, fragmentation, erosion, fragments.

N_t and N_p are the grains of the larger body, the target, and of the smaller one, N_1 those of the largest fragment.
The growth efficiency of a collision is f = (N_1 − N_t)/N_p ≤ 1 (Wada et al. 2013): 1 if the bodies stick, 0 if they
bounce, negative if the target loses mass. `io.growth_codes` writes the results for DustPy and mcdust.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..basics.arguments import checked
from ..basics.errors import BadInput, did_you_mean
from ..basics.units import si
from .collision_kinds import growth_efficiency
from .fits import falls_below


class Collisions(NamedTuple):
    """A table of collisions, one entry each."""

    speed: np.ndarray  # (K,) relative speed [m/s]
    target: np.ndarray  # (K,) N_t
    projectile: np.ndarray  # (K,) N_p ≤ N_t
    filling: np.ndarray  # (K,) volume filling factor; NaN if it is not given
    weight: np.ndarray  # (K,) weight of the impact parameter, 1 if it is not given
    fragments: list[np.ndarray]  # grains of each fragment, by decreasing number

    @property
    def growth(self) -> np.ndarray:
        """Growth efficiency f (K,)."""
        bodies = zip(self.target, self.projectile, self.fragments, strict=True)
        return np.array([growth_efficiency(first, second, one[0]) for first, second, one in bodies])

    @property
    def mass_ratio(self) -> np.ndarray:
        """N_t/N_p ≥ 1 (K,)."""
        return np.asarray(self.target / self.projectile)


class Efficiency(NamedTuple):
    """Averages over the collisions of one speed, mass ratio and filling factor."""

    mass_ratio: float
    filling: float
    speed: float  # [m/s]
    collisions: int
    growth: float  # mean of f
    growth_error: float  # its standard error; NaN for a single collision
    stick: float  # mean of max(f, 0): part of the projectile that stays, as a probability of sticking
    fragment: float  # share of collisions in which the target loses mass
    excavated: float  # mass that it loses then, in masses of the projectile


class Threshold(NamedTuple):
    """Speed at which the mean growth efficiency first falls below 0."""

    mass_ratio: float
    filling: float
    speed: float  # [m/s]; infinite if there is growth at all speeds of the table, 0 if at none
    least: float  # the same of the mean less its standard error
    most: float  # and of the mean plus its standard error


@checked
def collisions(
    table: Mapping[str, Any],
    *,
    speed: str = "speed",
    target: str | int = "target.grains",
    projectile: str | int = "projectile.grains",
    fragments: str = "fragments",
    filling: str | None = None,
    weight: str | None = None,
) -> Collisions:
    """Read a table of collisions, such as that of a sweep (`sand.open(DIR).done`), a data frame or a dictionary.

    Parameters
    ----------
    table : mapping
        Columns by name.
    speed, target, projectile, fragments : str, optional
        Names of the columns: relative speed [m/s], or text with a unit; numbers of grains of the bodies, which may be
        one number for all rows instead; numbers of grains of all fragments, a list or text such as "493 5 2".
    filling, weight : str, optional
        Names of the columns of filling factors and of weights, such as those of `impact_average.impact_weights`.

    Raises
    ------
    BadInput
        If a column is missing, has another length, or a value that is impossible; one line for each column.
    """
    chosen: dict[str, str | int | None] = {
        "speed": speed,
        "target": target,
        "projectile": projectile,
        "fragments": fragments,
    }
    chosen |= {"filling": filling, "weight": weight}
    names = {key: name for key, name in chosen.items() if isinstance(name, str)}
    problems = [
        f"the table has no column '{name}' for {key}; {did_you_mean(name, list(table))}"
        for key, name in names.items()
        if name not in table
    ]
    if problems:
        raise BadInput(problems)
    count = len(table[speed])
    if not count:
        raise BadInput("the table has no row")
    if wrong := [name for name in names.values() if len(table[name]) != count]:
        raise BadInput(f"column '{wrong[0]}' has {len(table[wrong[0]])} rows, but '{speed}' has {count}")
    lists = [_grains_of(one, f"{fragments}, row {k}") for k, one in enumerate(table[fragments])]
    speeds = np.array([si(_plain(one), "m/s", f"{speed}, row {k}", above=0.0) for k, one in enumerate(table[speed])])
    sizes = np.array([_numbers(table[one] if isinstance(one, str) else [one] * count) for one in (target, projectile)])
    for k, one in enumerate(lists):
        if sizes[:, k].sum() != one.sum():
            problems.append(f"row {k}: the fragments have {one.sum():g} grains, the bodies {sizes[:, k].sum():g}")
    if problems:
        raise BadInput(problems[:10])
    phi, w = (
        np.full(count, default) if name is None else _numbers(table[name])
        for name, default in ((filling, math.nan), (weight, 1.0))
    )
    return Collisions(speeds, sizes.max(axis=0), sizes.min(axis=0), phi, w, lists)


def _numbers(values: Iterable[Any]) -> np.ndarray:
    return np.array([float(one) for one in values])


def _plain(value: Any) -> Any:
    return value.item() if hasattr(value, "item") else value


def _grains_of(value: Any, place: str) -> np.ndarray:
    """Numbers of grains, by decreasing number.  Raises BadInput."""
    words = str(value).strip("[]() ").replace(",", " ").split() if isinstance(value, str) else value
    try:
        found = np.sort(np.array([float(word) for word in words]))[::-1]
    except (TypeError, ValueError):
        found = np.zeros(0)
    if not len(found) or not (found >= 1.0).all():
        raise BadInput(f"{place} = {value!r} must be numbers of grains, such as [493, 5, 2]")
    return found


def _groups(given: Collisions) -> list[tuple[tuple[float, float, float], np.ndarray]]:
    """Mass ratio, filling factor and speed of each group of alike collisions, and their numbers; in that order."""
    rows = np.column_stack([given.mass_ratio, np.nan_to_num(given.filling, nan=-1.0), given.speed])
    kinds, number = np.unique(rows, axis=0, return_inverse=True)
    keys = [(float(q), math.nan if phi < 0.0 else float(phi), float(v)) for q, phi, v in kinds]
    return [(key, np.flatnonzero(number.ravel() == k)) for k, key in enumerate(keys)]


def efficiencies(given: Collisions) -> list[Efficiency]:
    """Averages over the collisions of each mass ratio, filling factor and speed, with the weights.

    `stick` and `excavated` preserve the mean change of mass: stick − fragment × excavated is the mean of f. The
    probability of bouncing is 1 − stick − fragment.
    """
    rows, growth = [], given.growth
    for (ratio, filling, speed), chosen in _groups(given):
        f, w = growth[chosen], given.weight[chosen] / given.weight[chosen].sum()
        mean, lost = float(w @ f), float(w @ (f < 0.0))
        error = math.nan
        if len(f) > 1:
            error = math.sqrt(float(w**2 @ (f - mean) ** 2) * len(f) / (len(f) - 1))
        stick, excavated = float(w @ np.maximum(f, 0.0)), float(w @ np.maximum(-f, 0.0))
        numbers = len(f), mean, error, stick, lost, excavated / lost if lost else 0.0
        rows.append(Efficiency(ratio, filling, speed, *numbers))
    return rows


def thresholds(rows: Sequence[Efficiency]) -> list[Threshold]:
    """Fragmentation speed of each mass ratio and filling factor: where the mean of f first falls below 0.

    Between two speeds of the table f is linear in the logarithm of the speed.
    """
    found = []
    for key in dict.fromkeys((one.mass_ratio, str(one.filling)) for one in rows):
        group = sorted((one for one in rows if (one.mass_ratio, str(one.filling)) == key), key=lambda one: one.speed)
        speeds = np.array([one.speed for one in group])
        mean = np.array([one.growth for one in group])
        error = np.nan_to_num([one.growth_error for one in group])
        crossings = (_crossing(speeds, f) for f in (mean, mean - error, mean + error))
        found.append(Threshold(group[0].mass_ratio, group[0].filling, *crossings))
    return found


def _crossing(speed: np.ndarray, f: np.ndarray) -> float:
    """Speed at which f first becomes negative; 0 if it is so at the lowest one, infinite if at none."""
    if f[0] < 0.0:
        return 0.0
    found = falls_below(speed, f, 0.0)
    return math.inf if math.isnan(found) else found


def rate_average(speed: Any, value: Any, rms: Any) -> np.ndarray:
    """Average of a function of the speed over collisions whose speeds have a Maxwell distribution.

    ⟨F⟩ = ∫ F(v) v³ exp(−3v²/2v_rms²) dv / ∫ v³ exp(−3v²/2v_rms²) dv: the third power of v, because fast pairs collide
    more often. For a step at v_f this is (1 + 3x²/2) exp(−3x²/2) with x = v_f/v_rms, the probability of fragmentation
    of DustPy.

    Parameters
    ----------
    speed, value : array_like
        Increasing speeds (K,) [m/s] and F (K,); linear between them, constant beyond.
    rms : array_like
        v_rms [m/s], of any shape.
    """
    from scipy.special import gamma, gammaincc

    v, f, size = np.asarray(speed, float), np.asarray(value, float), np.asarray(rms, float)[..., None]
    u = 1.5 * (v / size) ** 2  # distributed as u e^(−u)
    beyond, mean_beyond = gammaincc(2.0, u), size * math.sqrt(2.0 / 3.0) * gamma(2.5) * gammaincc(2.5, u)
    slope = np.diff(f) / np.diff(v)
    within, mean_within = -np.diff(beyond, axis=-1), -np.diff(mean_beyond, axis=-1)
    inside = ((f[:-1] - slope * v[:-1]) * within + slope * mean_within).sum(axis=-1)
    return np.asarray(inside + f[0] * (1.0 - beyond[..., 0]) + f[-1] * beyond[..., -1])


class FragmentSlope(NamedTuple):
    """Exponent γ of the number of fragments n(m) ∝ m^γ."""

    exponent: float
    error: float  # standard error
    fragments: int


def fragment_slope(given: Collisions, largest: bool = False) -> FragmentSlope:
    """Exponent γ of the numbers of fragments of m grains, n(m) ∝ m^γ, 1 ≤ m ≤ m_max, by maximum likelihood.

    The likelihood is that of whole numbers up to the largest fragment that is counted, ln L = γ Σ ln m − n ln Σ_k k^γ.

    Parameters
    ----------
    largest : bool, optional
        Whether the largest fragment of each collision, the remnant, is counted.

    Raises
    ------
    BadInput
        If there are fewer than two sizes of fragments.
    """
    from scipy.optimize import minimize_scalar

    sizes = np.concatenate([one if largest else one[1:] for one in given.fragments])
    if len(np.unique(sizes)) < 2:
        raise BadInput(f"{len(sizes)} fragments have fewer than two sizes, too few for an exponent")
    logs = np.log(np.arange(1, int(sizes.max()) + 1))
    mean = float(np.log(sizes).mean())

    def minus_likelihood(exponent: float) -> float:
        return float(np.logaddexp.reduce(exponent * logs) - exponent * mean)

    best = float(minimize_scalar(minus_likelihood, bounds=(-10.0, 5.0), method="bounded", options={"xatol": 1e-9}).x)
    weight = np.exp(best * logs - np.logaddexp.reduce(best * logs))
    variance = float(weight @ logs**2 - (weight @ logs) ** 2)  # of ln m, the Fisher information of one fragment
    return FragmentSlope(best, 1.0 / math.sqrt(variance * len(sizes)), len(sizes))


def fragment_masses(given: Collisions, edges: Any) -> list[tuple[tuple[float, float, float], np.ndarray]]:
    """Mass of the fragments in bins of their size, as a part of the mass of both bodies.

    Parameters
    ----------
    edges : array_like
        Increasing edges (B + 1,) of the bins of the mass of a fragment over that of both bodies.

    Returns
    -------
    list
        Mass ratio, filling factor and speed of each group of alike collisions, and the parts (B,), whose sum is 1 if
        the bins hold all fragments.
    """
    limits, total = np.asarray(edges, float), given.target + given.projectile
    parts = [np.histogram(one / total[k], limits, weights=one / total[k])[0] for k, one in enumerate(given.fragments)]
    return [
        (key, np.average([parts[k] for k in chosen], axis=0, weights=given.weight[chosen]))
        for key, chosen in _groups(given)
    ]
