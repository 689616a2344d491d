"""Settings of the contact model: `sand.Contact`."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence, Set
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from ..basics.arguments import checked
from ..basics.box import Box
from ..basics.errors import BadInput, naming, shown
from ..basics.grains import Grains
from ..basics.material import Material, contact_settings
from ..basics.ramps import rampable
from ..basics.settings import RAMP, For, Number, Settings, Word
from ..basics.units import format_quantity
from . import dmt, jkr  # noqa: F401  # every contact law is registered by its import, here
from .law import LAWS, ContactLaw, Pairing
from .mixing import MIXING, pairing_between

DEFAULT_DAMPING_RATIO = 0.2
DAMPED_SPEED_GAIN = 3.4
"""Largest sticking speed with the default damping ratio over that without damping (docs/physics/contact-options.md)."""
_CONSTANT = "a number in kg/s, such as '1e-9 kg/s'"
_VISCOUS_TIME = "a time in s, such as '1.25e-11 s' for silica; it depends on the material and the size of the grains"


@checked
@rampable
@dataclass(frozen=True)
class Contact(Settings):
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
        collective modes. Momentum and angular momentum of every cluster are kept; the rigid motion of a cluster
        with driven grains (`sand.Driven`) is that of these. Slow restructuring is slowed down as well. Energy removed:
        `lost_settling`. No noise belongs to it: with a bath, contacts are colder than T. Default: none.
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

    slip: Annotated[str, Word("clamp", "reset")] = "clamp"
    stiffness: Annotated[str, Word("frozen", "dt97")] = "frozen"
    slide_factor: Annotated[Any, Number(least=0.0), RAMP] = 1.0
    roll_factor: Annotated[Any, Number(least=0.0), RAMP] = 1.0
    twist_factor: Annotated[Any, Number(least=0.0), RAMP] = 1.0
    surface_energy_factor: Annotated[Any, Number(least=0.0), RAMP] = 1.0
    rolling_limit: Annotated[Any, Number("m", above=0.0), RAMP] = None
    damping: Annotated[str, Word("none", "critical", "constant", "viscoelastic")] = "none"
    damping_ratio: Annotated[
        Any, Number(above=0.0, most=5.0), RAMP, For("damping", "critical", default=DEFAULT_DAMPING_RATIO)
    ] = None
    damping_constant: Annotated[Any, Number("kg/s", above=0.0), RAMP, For("damping", "constant", needed=_CONSTANT)] = (
        None
    )
    viscous_time: Annotated[Any, Number("s", above=0.0), RAMP, For("damping", "viscoelastic", needed=_VISCOUS_TIME)] = (
        None
    )
    bath_temperature: Annotated[Any, Number("K", above=0.0), RAMP] = None
    settling_time: Annotated[Any, Number("s", above=0.0), RAMP] = None
    mixing: Annotated[str, Word(among=MIXING)] = "geometric"
    law: Annotated[str, Word(among=LAWS)] = "jkr"

    name = "contact"
    references = (
        "Johnson, Kendall & Roberts 1971; Derjaguin, Muller & Toporov 1975; Dominik & Tielens 1997; "
        "Dominik & Nübold 2002, A.5–A.6"
    )

    def contradictions(self, wrong: Set[str]) -> Iterator[str]:
        """A bath without damping."""
        if "damping" not in wrong and self.damping == "none" and self.bath_temperature is not None:
            yield "bath_temperature needs damping, which exchanges energy with the bath; set damping = 'critical'"

    @classmethod
    @checked
    def like(cls, preset: str, **changes: Any) -> Contact:
        """Return the contact model of a paper, with some settings changed.

        Parameters
        ----------
        preset : str
            Name of the paper's material, such as "silica (Seizinger et al. 2012)"; case is ignored. The material is
            chosen where grains are made: `sand.Material.like`.
        changes
            Arguments of `Contact`, which override those of the paper.

        Raises
        ------
        BadInput
            If there is no such preset, or a setting is unknown or out of range.
        """
        return cls(**contact_settings(preset) | changes)

    @staticmethod
    def with_paper(table: Any) -> Any:
        """Settings in a table [forces.contact] with a key `like`: those of the paper, replaced by those given.

        Anything but a table with this key stays as it is. Raises BadInput if there is no such preset.
        """
        if not isinstance(table, dict) or "like" not in table:
            return table
        given = dict(table)
        preset = given.pop("like")
        if not isinstance(preset, str):
            raise BadInput(f"like = {shown(preset)} must be the name of a preset, as in docs: Materials")
        with naming("like"):
            return contact_settings(preset) | given

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
