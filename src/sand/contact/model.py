"""Settings of the contact model: `sand.Contact`."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ..basics.arguments import checked
from ..basics.box import Box
from ..basics.grains import Grains
from ..basics.material import Material
from ..basics.ramps import rampable
from ..basics.units import format_quantity, si
from ..errors import FORBID_EXTRA, BadInput, did_you_mean
from . import dmt, jkr  # noqa: F401  # every contact law is registered by its import, here
from .law import LAWS, ContactLaw, Pairing
from .mixing import MIXING, pairing_between

LIMIT_RULES = ("clamp", "reset")
STIFFNESS = ("frozen", "dt97")
DAMPING = ("none", "critical", "constant", "viscoelastic")
DAMPING_KEYS = {"damping_ratio": "critical", "damping_constant": "constant", "viscous_time": "viscoelastic"}
"""Parameters of the kinds of damping, and the kind that each belongs to."""
DEFAULT_DAMPING_RATIO = 0.2
DAMPED_SPEED_GAIN = 3.4
"""Largest sticking speed with the default damping ratio over that without damping (docs/physics/contact-options.md)."""
MAX_DAMPING_RATIO = 5.0
FACTORS = ("slide_factor", "roll_factor", "twist_factor", "surface_energy_factor")
"""Settings that multiply a constant of all contacts."""
RAMPABLE = (
    *FACTORS,
    *("rolling_limit", "damping_ratio", "damping_constant", "viscous_time", "bath_temperature", "settling_time"),
)
"""Settings that may change during a run."""


@checked
@rampable(*RAMPABLE)
@dataclass(frozen=True)
class Contact:
    """Adhesive contacts: normal force of a contact law, and springs against sliding, rolling and twisting.

    Parameters
    ----------
    slip : str, optional
        Rule for a tangential displacement beyond its limit.  "clamp" sets it to the limit; "reset" sets it to 0, as
        in the SAND paper (A.6), which halves rolling friction.
    stiffness : str, optional
        Tangential stiffnesses.  "frozen": evaluated at the equilibrium radius a0, so that forces are exact gradients of
        the energy.  "dt97": functions of the contact radius, k_s ∝ a, k_r ∝ a^(3/2), k_t ∝ a³; energy is not conserved,
        and the energy created or destroyed is logged as `lost_stiffness`.
    slide_factor, roll_factor, twist_factor : float or str, optional
        Multipliers ≥ 0 of k_s, k_r, k_t (Seizinger et al. 2012 use 2.5, 8 and 1).
    surface_energy_factor : float, str or Ramp, optional
        Multiplier ≥ 0 of γ_eff of all contacts, 1 by default. A `Ramp` lets grains lose or gain adhesion during a run;
        all numbers here may be ramps.
    rolling_limit : float or str, optional
        Critical rolling displacement ξ_c [m] > 0 of all contacts.  Default: the smaller of the values of the two
        materials.
    damping : str, optional
        "none", for collisions, whose thresholds damping would move. "critical": dashpots on all four modes, each with a
        share ζ of its critical damping, c_q = 2ζ √(k_q m_q), for growth, where nothing else removes the vibrations that
        every touch leaves; with the default ζ grains stick up to 3.4 times the speed. Damping of the normal motion
        alone: "constant" (F = c dδ/dt) or "viscoelastic" (Krijt et al. 2013: F = (2 T_vis E*/ν²) a dδ/dt, with ν1 ν2
        in place of ν² for unequal materials).
    damping_ratio : float, optional
        ζ, above 0, at most 5; for "critical", whose default is 0.2. Steps are shorter above 0.25.
    damping_constant : float or str, optional
        c [kg/s] > 0, for "constant".
    viscous_time : float or str, optional
        T_vis [s] > 0, for "viscoelastic"; 1.25e-11 s for silica grains of some 0.1 µm.
    bath_temperature : float or str, optional
        Temperature T > 0 [K] of the bath behind the dashpots: each has a random load of variance 2 k_B T c/dt, so that
        vibrations of grains in contact have the mean energy k_B T per mode. Default: no noise, T = 0.
    settling_time : float or str, optional
        τ [s] > 0: velocities of grains relative to the rigid motion of their cluster are multiplied by
        e^(−t/τ). The energy of modes with ω > 1/2τ decays as e^(−t/τ), whereas dashpots hardly damp slow
        collective modes. Momentum and angular momentum of every cluster are kept; slow restructuring is slowed
        down as well. Energy removed: `lost_settling`. No noise belongs to it: with a bath, contacts are colder
        than T. Default: none.
    mixing : str, optional
        γ_eff of unequal materials: "geometric" √(γ1γ2), "harmonic" 2γ1γ2/(γ1+γ2), or "smaller".
    law : str, optional
        Normal force, a registered contact law: "jkr", for soft, large, adhesive grains, or "dmt", for small Tabor
        parameters.  See `sand.contact.law.ContactLaw` for a law of your own.

    Raises
    ------
    BadInput
        If a setting is unknown or out of range; one line for each.
    """

    slip: str = "clamp"
    stiffness: str = "frozen"
    slide_factor: Any = 1.0
    roll_factor: Any = 1.0
    twist_factor: Any = 1.0
    surface_energy_factor: Any = 1.0
    rolling_limit: Any = None
    damping: str = "none"
    damping_ratio: Any = None
    damping_constant: Any = None
    viscous_time: Any = None
    bath_temperature: Any = None
    settling_time: Any = None
    mixing: str = "geometric"
    law: str = "jkr"

    __pydantic_config__ = FORBID_EXTRA
    name = "contact"
    references = (
        "Johnson, Kendall & Roberts 1971; Derjaguin, Muller & Toporov 1975; Dominik & Tielens 1997; "
        "Dominik & Nübold 2002, A.5–A.6"
    )

    def __post_init__(self) -> None:
        problems: list[str] = []
        words = {"slip": LIMIT_RULES, "stiffness": STIFFNESS, "damping": DAMPING}
        words |= {"mixing": tuple(MIXING), "law": tuple(LAWS)}
        for key, allowed in words.items():
            if getattr(self, key) not in allowed:
                given = getattr(self, key)
                problems.append(f"contact: {key} = {given!r}; {did_you_mean(str(given), allowed)}")
        for key in FACTORS:
            try:
                object.__setattr__(self, key, si(getattr(self, key), "1", f"contact: {key}", least=0.0))
            except BadInput as error:
                problems += error.problems
        if self.damping == "critical" and self.damping_ratio is None:
            object.__setattr__(self, "damping_ratio", DEFAULT_DAMPING_RATIO)
        optional = {"rolling_limit": "m", "damping_constant": "kg/s", "viscous_time": "s", "bath_temperature": "K"}
        optional["settling_time"] = "s"
        for key, unit in (optional | {"damping_ratio": "1"}).items():
            try:
                if getattr(self, key) is not None:
                    most = MAX_DAMPING_RATIO if key == "damping_ratio" else math.inf
                    object.__setattr__(self, key, si(getattr(self, key), unit, f"contact: {key}", above=0.0, most=most))
            except BadInput as error:
                problems += error.problems
        problems += self._damping_problems()
        if problems:
            raise BadInput(problems)

    def _damping_problems(self) -> list[str]:
        """Parameters of damping that are missing, or that belong to another kind of damping."""
        if self.damping not in DAMPING:
            return []
        problems = [
            f"contact: {key} is given, but damping = {self.damping!r} does not use it; remove it, or set "
            f"damping = {kind!r}"
            for key, kind in DAMPING_KEYS.items()
            if getattr(self, key) is not None and self.damping != kind
        ]
        if self.damping == "constant" and self.damping_constant is None:
            problems.append("contact: damping = 'constant' needs a damping_constant above 0, such as '1e-9 kg/s'")
        if self.damping == "viscoelastic" and self.viscous_time is None:
            problems.append(
                "contact: damping = 'viscoelastic' needs a viscous_time above 0, such as '1.25e-11 s' for silica; "
                "it depends on the material and the size of the grains"
            )
        if self.damping == "none" and self.bath_temperature is not None:
            problems.append(
                "contact: bath_temperature needs damping, which exchanges energy with the bath; "
                "set damping = 'critical'"
            )
        return problems

    def parameters(self) -> dict[str, Any]:
        """Settings in SI units; settings that are None are omitted."""
        return {key: value for key, value in asdict(self).items() if value is not None}

    @property
    def contact_law(self) -> ContactLaw:
        """The registered contact law of this name."""
        return LAWS[self.law]

    def pairing(self, a: Material, b: Material) -> Pairing:
        """Contact parameters of two materials under these settings."""
        return pairing_between(
            a,
            b,
            mixing=self.mixing,
            rolling_limit=self.rolling_limit,
            factors=(self.slide_factor, self.roll_factor, self.twist_factor),
            surface_energy_factor=self.surface_energy_factor,
            damping=self.damping_constant or 0.0,
            viscous_time=self.viscous_time or 0.0,
            damping_ratio=self.damping_ratio or 0.0,
        )

    def pairings(self, materials: Sequence[Material]) -> np.ndarray:
        """Table (11, M, M) of `Pairing` for every two materials."""
        table = [[self.pairing(a, b) for b in materials] for a in materials]
        return np.ascontiguousarray(np.moveaxis(np.array(table, dtype=np.float64), -1, 0))

    def check(self, grains: Grains, box: Box) -> list[str]:
        """Check that the materials suit the contact model.

        Returns
        -------
        list of str
            A warning for each pair of materials for which the contact law is inaccurate.

        Raises
        ------
        BadInput
            If a material has no surface energy, or no positive Poisson ratio for viscoelastic damping.
        """
        problems = [
            f"material '{m.name}' has no surface energy; give one, 0 for none: "
            f'{m.name} with surface_energy = "… J/m^2"'
            for m in grains.materials
            if m.surface_energy is None
        ]
        if self.damping == "viscoelastic":
            problems += [
                f"material '{m.name}' has poisson_ratio {m.poisson_ratio:g}: viscoelastic damping needs one above 0"
                for m in grains.materials
                if not m.poisson_ratio > 0.0
            ]
        if problems:
            raise BadInput(problems)
        cold = []
        if self.settling_time is not None and self.bath_temperature is not None:
            cold = ["contact: settling_time has no noise, so that contacts become colder than bath_temperature"]
        of_material = [grains.radius[grains.material == k] for k in range(len(grains.materials))]
        # JKR is least accurate for the smallest grains, DMT for the largest
        extremes = [sorted({float(radius.min()), float(radius.max())}) for radius in of_material]
        return cold + [
            text
            for k, a in enumerate(grains.materials)
            for j in range(k + 1)
            if (text := self._inaccurate(a, extremes[k], grains.materials[j], extremes[j]))
        ]

    def _inaccurate(self, a: Material, radii1: list[float], b: Material, radii2: list[float]) -> str:
        """A warning if the contact law is inaccurate for contacts between such grains, else ""."""
        both = self.pairing(a, b)
        for r1, r2 in itertools.product(radii1, radii2):
            reason = self.contact_law.warning(both.surface_energy, both.modulus, r1 * r2 / (r1 + r2))
            if reason:
                names = a.name if a is b else f"{a.name} and {b.name}"
                sizes = " and ".join(format_quantity(r, "m") for r in dict.fromkeys((r1, r2)))
                return f"contacts of {names} grains of radius {sizes} have {reason}"
        return ""
