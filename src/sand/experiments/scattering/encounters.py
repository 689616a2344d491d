"""What two bodies are sent past each other, and how: the numbers of scattering experiments."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from ...constants import MAGNETIC
from ...forces.pair import dipole_formulas as dipole
from ...grains import Grains
from .flight_driver import Limits
from .initial_conditions import InitialConditions
from .two_aggregates import TWO_AGGREGATES, Aggregates, Body
from .two_spheres import TWO_SPHERES, Model, Spheres

MOST_STEPS = 2_000_000
"""A flight that is not over after so many steps is called bound."""


class Scales(NamedTuple):
    """What everything is measured in."""

    reduced: float  # m̄ [kg]
    touch: float  # sum of the radii, of outer spheres for aggregates [m]
    alpha: float  # 2kμμ′ [J m³], with Σ|μ| for aggregates
    capture: float  # b_max (Eqs. 12, 13) at the speed of the flight [m]; 0 without moments
    widest: float  # impact parameter [m] that a central potential −α/r³ captures at most, focusing included


@dataclass(frozen=True)
class Flight:
    """Two bodies and how they meet; SI, all checked (experiments/scattering/problem.py makes one from what users say).

    Attributes
    ----------
    projectile, target : Grains
        grains; the projectile comes in along `along`, the target has the velocity `drift`.
    speed : float
        v∞ of the projectile [m/s]; temperature: [K], of spins and of a target that moves by chance.
    distance : float
        of the plane, or the radius of the sphere, that flights start on [m]; sphere: which of the two.
    escape : float
        distance [m] beyond which one that flies away is gone; 0: that of its start.
    axes : int
        RANDOM, ALIGNED or GIVEN of experiments/scattering/initial_conditions.py.
    spin : tuple[tuple[float, float, float], tuple[float, float, float]]
        three components [rad/s] of projectile and target, a thermal spin of `spin_energy` [J] each is added.
    drift_spread : float
        standard deviation of each component of the target's velocity [m/s].  Impact parameters are
        those of the relative motion.
    field : tuple[float, float, float]
        external flux density [T]; tolerance: error of a step over the scales.
    contact : bool
        go on through the real contact, and count only what sticks.
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
    most_steps: int = MOST_STEPS
    temperature: float = 0.0
    contact: bool = False

    @property
    def spheres(self) -> bool:
        """True for one grain against one."""
        return len(self.projectile) == len(self.target) == 1

    @property
    def scales(self) -> Scales:
        """Sizes in closed form."""
        return scales_of(self.projectile, self.target, self.relative_speed)

    @property
    def relative_speed(self) -> float:
        """|v∞ − drift| [m/s]; a target that moves by chance counts as at rest on average."""
        return math.dist([self.speed * a for a in self.along], self.drift)

    @property
    def analytic(self) -> float:
        """Eq. 14 [m²] at the relative speed; for a target that moves by chance ⟨σ_Eq14(u) u⟩/v∞, as σ is told."""
        plain = math.pi * self.scales.capture**2
        if self.drift_spread == 0.0:
            return plain
        return plain * mean_power(-1.0 / 3.0, self.speed, self.drift_spread)

    def start(self, azimuth: float = -1.0) -> InitialConditions:
        """For the kernel; azimuth [rad] of the impact parameter, below 0: by chance."""
        axes = [_axis(g) for g in (self.projectile, self.target)]
        return InitialConditions(
            self.speed,
            self.along,
            self.drift,
            self.drift_spread,
            self.distance,
            self.sphere,
            azimuth,
            self.axes,
            axes[0],
            axes[1],
            *self.spin,
            *self.spin_energy,
        )

    def pair(self) -> tuple[Model, Spheres | Aggregates]:
        """The kind of pair and its numbers, for the kernel."""
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
        """For the kernel."""
        s = self.scales
        return Limits(self.tolerance, self.escape, self.most_steps, s.touch, s.reduced)


def scales_of(projectile: Grains, target: Grains, speed: float) -> Scales:
    """Sizes in closed form of two bodies that meet at this speed [m/s]."""
    m1, m2 = float(projectile.mass.sum()), float(target.mass.sum())
    reduced = m1 * m2 / (m1 + m2)
    touch = extent(projectile) + extent(target)
    strong = [float(np.linalg.norm(g.moment, axis=1).sum()) for g in (projectile, target)]
    alpha = dipole.contact_energy(*strong, 1.0, MAGNETIC)
    capture = float(dipole.capture_radius(*strong, reduced, speed, MAGNETIC))
    focused = touch * math.sqrt(1.0 + 2.0 * alpha / (touch**3 * reduced * speed**2))
    # where the top of the barrier, b_max/√3 away, lies inside the grains, they touch before it matters
    widest = capture if capture > math.sqrt(3.0) * touch else focused
    return Scales(reduced, touch, alpha, capture, widest)


def mean_power(power: float, speed: float, spread: float) -> float:
    """⟨(u/v)^p⟩ for u = |v − w|, each component of w normal with this standard deviation [m/s]."""
    u = np.linspace(0.0, speed + 12.0 * spread, 20_001)[1:]
    near, far = ((u - speed) / spread) ** 2, ((u + speed) / spread) ** 2
    density = u / (speed * spread * math.sqrt(2.0 * math.pi)) * (np.exp(-0.5 * near) - np.exp(-0.5 * far))
    return float(np.trapezoid(density * (u / speed) ** power, u) / np.trapezoid(density, u))


def extent(body: Grains) -> float:
    """Outermost surface of a body from its centre of mass [m]."""
    middle = np.average(body.position, axis=0, weights=body.mass)
    return float((np.linalg.norm(body.position - middle, axis=1) + body.radius).max())


def _axis(body: Grains) -> tuple[float, float, float]:
    """Direction of the first grain's moment; +x without one."""
    moment = body.moment[0]
    size = float(np.linalg.norm(moment))
    x, y, z = moment / size if size > 0.0 else (1.0, 0.0, 0.0)
    return float(x), float(y), float(z)


def body_of(grains: Grains) -> Body:
    """Grains as a rigid body in its principal frame."""
    mass, count = grains.mass, len(grains)
    arm = grains.position - np.average(grains.position, axis=0, weights=mass)
    round_ = (mass * (arm**2).sum(axis=1) + grains.inertia).sum()
    tensor = round_ * np.eye(3) - np.einsum("i,ij,ik->jk", mass, arm, arm)
    inertia, frame = np.linalg.eigh(tensor)
    frame[:, 2] = np.cross(frame[:, 0], frame[:, 1])  # right-handed; eigenvectors are so up to a sign
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
