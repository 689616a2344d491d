"""Set-up of a scattering experiment: two bodies, their initial conditions and scales."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from ...basics.constants import MAGNETIC
from ...basics.grains import Grains
from ...forces.pair import dipole_formulas as dipole
from ...numerics.rotor import principal_frame
from .flight_driver import Limits
from .initial_conditions import InitialConditions
from .two_aggregates import TWO_AGGREGATES, Aggregates, Body
from .two_spheres import TWO_SPHERES, Model, Spheres

MOST_FLIGHT_STEPS = 2_000_000
"""Largest number of steps of a flight; flights that reach it are bound."""


class Scales(NamedTuple):
    """Scales of an encounter in closed form."""

    reduced: float  # m̄ [kg]
    touch: float  # sum of the radii, of bounding spheres for aggregates [m]
    alpha: float  # 2kμμ′ [J m³], with Σ|μ| for aggregates
    capture: float  # b_max (Dominik & Nübold 2002, Eqs. 12, 13) [m]; 0 without moments
    widest: float  # largest impact parameter captured by a central potential −α/r³, focusing included [m]


@dataclass(frozen=True)
class Flight:
    """Set-up of a scattering experiment in checked SI values; `problem.flight` builds it from user input.

    Attributes
    ----------
    projectile, target : Grains
        The bodies. The projectile approaches along `along`; the target has the velocity `drift`.
    speed : float
        Speed v∞ of the projectile [m/s].
    distance : float
        Distance of the plane, or radius of the sphere, on which flights start [m].
    sphere : bool
        Whether flights start on a sphere.
    escape : float
        Distance [m] beyond which a receding body has escaped; 0: that of its start.
    along : tuple of float
        Unit vector of the velocity of the projectile.
    drift : tuple of float
        Mean velocity of the target [m/s].
    drift_spread : float
        Standard deviation of each component of the target's velocity [m/s]. Impact parameters are those of the relative
        motion.
    axes : int
        `RANDOM`, `ALIGNED` or `GIVEN` of `initial_conditions`.
    spin : tuple
        Spins of projectile and target [rad/s], to which thermal spins of mean energy `spin_energy` are added.
    spin_energy : tuple of float
        Mean energies of the thermal spins [J].
    field : tuple of float
        External flux density [T].
    tolerance : float
        Error of a step over the scales.
    most_steps : int
        Largest number of steps of a flight; flights that reach it are bound.
    temperature : float
        Temperature [K] of spins and of the target's velocity.
    contact : bool
        Whether to simulate the contact after a hit, and count only hits that stick.
    """

    projectile: Grains
    target: Grains
    speed: float
    distance: float
    sphere: bool = False
    escape: float = 0.0
    along: tuple[float, float, float] = (1.0, 0.0, 0.0)
    drift: tuple[float, float, float] = (0.0, 0.0, 0.0)
    drift_spread: float = 0.0
    axes: int = 0
    spin: tuple[tuple[float, float, float], tuple[float, float, float]] = ((0.0,) * 3, (0.0,) * 3)
    spin_energy: tuple[float, float] = (0.0, 0.0)
    field: tuple[float, float, float] = (0.0, 0.0, 0.0)
    tolerance: float = 1e-8
    most_steps: int = MOST_FLIGHT_STEPS
    temperature: float = 0.0
    contact: bool = False

    @property
    def spheres(self) -> bool:
        """Whether both bodies are single grains."""
        return len(self.projectile) == len(self.target) == 1

    @property
    def scales(self) -> Scales:
        """Scales at the relative speed."""
        return scales_of(self.projectile, self.target, self.relative_speed)

    @property
    def relative_speed(self) -> float:
        """Relative speed |v∞ − drift| [m/s]; a random target velocity counts with its mean."""
        return math.dist([self.speed * a for a in self.along], self.drift)

    @property
    def analytic(self) -> float:
        """Cross-section of Eq. 14 [m²] at the relative speed; for a random target velocity ⟨σ_Eq14(u) u⟩/v∞."""
        plain = math.pi * self.scales.capture**2
        if self.drift_spread == 0.0:
            return plain
        return plain * mean_power(-1.0 / 3.0, self.speed, self.drift_spread)

    def start(self, azimuth: float = -1.0) -> InitialConditions:
        """Initial conditions for the kernel; the azimuth [rad] of the impact parameter is random if negative."""
        own = {name: getattr(self, name) for name in InitialConditions._fields if hasattr(self, name)}
        return InitialConditions(**own, axis=(_axis(self.projectile), _axis(self.target)), azimuth=azimuth)

    def pair(self) -> tuple[Model, Spheres | Aggregates]:
        """Equations of motion of the pair and their parameters, for the kernel."""
        one, two = self.projectile, self.target
        if self.spheres:
            sizes = [float(np.linalg.norm(g.moment[0])) for g in (one, two)]
            radii = [float(g.radius[0]) for g in (one, two)]
            return TWO_SPHERES, Spheres(
                k=MAGNETIC,
                reduced=self.scales.reduced,
                moment1=sizes[0],
                moment2=sizes[1],
                inertia1=float(one.inertia[0]),
                inertia2=float(two.inertia[0]),
                touch=sum(radii),
                smallest=min(radii),
                field=self.field,
            )
        smallest = float(min(one.radius.min(), two.radius.min()))
        return TWO_AGGREGATES, Aggregates(
            MAGNETIC, self.scales.reduced, body_of(one), body_of(two), smallest, self.field
        )

    def limits(self) -> Limits:
        """End conditions and accuracy, for the kernel."""
        s = self.scales
        return Limits(self.tolerance, self.escape, self.most_steps, s.touch, s.reduced)


def scales_of(projectile: Grains, target: Grains, speed: float) -> Scales:
    """Scales of two bodies with this relative speed [m/s]."""
    m1, m2 = float(projectile.mass.sum()), float(target.mass.sum())
    reduced = m1 * m2 / (m1 + m2)
    touch = extent(projectile) + extent(target)
    strong = [float(np.linalg.norm(g.moment, axis=1).sum()) for g in (projectile, target)]
    alpha = dipole.contact_energy(*strong, 1.0, MAGNETIC)
    capture = float(dipole.capture_radius(*strong, reduced, speed, MAGNETIC))
    focused = touch * math.sqrt(1.0 + 2.0 * alpha / (touch**3 * reduced * speed**2))
    # if the top of the centrifugal barrier, at b_max/√3, lies inside the grains, they touch before reaching it
    widest = capture if capture > math.sqrt(3.0) * touch else focused
    return Scales(reduced, touch, alpha, capture, widest)


def mean_power(power: float, speed: float, spread: float) -> float:
    """Mean ⟨(u/v)^p⟩ of u = |v − w|, each component of w normal with this standard deviation [m/s]."""
    u = np.linspace(0.0, speed + 12.0 * spread, 20_001)[1:]
    near, far = ((u - speed) / spread) ** 2, ((u + speed) / spread) ** 2
    density = u / (speed * spread * math.sqrt(2.0 * math.pi)) * (np.exp(-0.5 * near) - np.exp(-0.5 * far))
    return float(np.trapezoid(density * (u / speed) ** power, u) / np.trapezoid(density, u))


def extent(body: Grains) -> float:
    """Outer radius of a body about its centre of mass [m]."""
    middle = np.average(body.position, axis=0, weights=body.mass)
    return float((np.linalg.norm(body.position - middle, axis=1) + body.radius).max())


def _axis(body: Grains) -> tuple[float, float, float]:
    """Direction of the first grain's moment; +x without a moment."""
    moment = body.moment[0]
    size = float(np.linalg.norm(moment))
    x, y, z = moment / size if size > 0.0 else (1.0, 0.0, 0.0)
    return float(x), float(y), float(z)


def body_of(grains: Grains) -> Body:
    """Rigid body of these grains, in its principal frame."""
    mass, count = grains.mass, len(grains)
    arm = grains.position - np.average(grains.position, axis=0, weights=mass)
    inertia, frame = principal_frame(mass, grains.inertia, arm.T)
    pose = Rotation.from_matrix(frame).as_quat()
    return Body(
        np.ascontiguousarray((arm @ frame).T),
        np.ascontiguousarray((grains.moment @ frame).T),
        grains.radius.copy(),
        np.zeros((3, count)),
        np.zeros((3, count)),
        tuple(float(i) for i in inertia),
        tuple(float(q) for q in pose),
        float(np.linalg.norm(grains.moment, axis=1).sum()),
        extent(grains),
    )
