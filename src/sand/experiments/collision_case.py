"""Case files of `sand collide`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from ..basics.arguments import MOST_GRAINS
from ..basics.grains import Grains
from ..basics.material import Library, Material
from ..basics.settings import For, List, Number, Reading, Whole, Word, declared
from ..config.case import ForcesSection, MaterialSection, library_of, material_errors, read_content
from ..config.key_errors import validate
from ..config.sections import Moment, PathName, Section, Seeds, Stepping, with_integrator
from ..integrate.verlet import Verlet
from ..setup.aggregates import KINDS, build
from ..setup.encounters import offset_of
from ..setup.from_file import body_from_file
from ..setup.grain_classes import BODY_FILE, Radii
from ..setup.moments import MOMENT_MODES
from ..simulation.cadence import FRAMES
from ..simulation.simulation import Simulation
from .collision import Approach, Collision, Ending, approach, prepare, run_to_end

BodyKind = Annotated[str, Word("file", among=KINDS)]
"""A builder, or "file"."""


class BodySection(Section):
    """Sections [target] and [projectile]: an aggregate (a different one for each seed if it is random), or a file."""

    kind: BodyKind
    """Builder (as for `sand build`), or `file`."""
    file: Annotated[PathName | None, For("kind", "file", needed=BODY_FILE)] = None
    """File of the body, relative to the case file, in any format of `file` in [grains]; required with
    `kind = "file"`."""
    length: Annotated[str | None, For("kind", "file")] = None
    """Unit of the file's lengths, such as 1 nm; default 1 Å in XYZ, 1 m in columns; GSD of other programs needs it."""
    grains: Annotated[int | None, Whole(1, MOST_GRAINS)] = None
    """Number of grains; required except for a grain, a lattice or a file."""
    shape: Annotated[list[int] | None, List(Whole(1, MOST_GRAINS))] = None
    """Grains along the three sides of a lattice, such as [5, 5, 5]; required for `lattice` and `hexagonal`."""
    radius: Radii = None
    """Radius of the grains [m] or a distribution, such as "lognormal(0.1 um, 0.3)"; one length for a file without
    radii."""
    material: str = "silica"
    """Preset or name in [materials]."""
    moment: Annotated[Moment, For("kind", *KINDS)] = None
    """Moment of each magnetic grain [A m^2], per mass ("200 A m^2/kg"), or "material"; none: no moments."""
    moments: Annotated[str | None, Word(among=MOMENT_MODES)] = None
    """Directions of the moments: `random`, `aligned` or `relaxed`."""
    magnetic: Any = None
    """Fraction of the grains that have a moment, 0 … 1; none: 1."""
    dimension: Any = None
    """Fractal dimension; for `kind = "fractal"` only."""
    prefactor: Any = None
    """Fractal prefactor; for `kind = "fractal"` only."""

    def contradictions(self) -> Iterator[str]:
        """Radii and numbers of grains that are missing, and a lattice that is too large."""
        regular = self.kind in ("lattice", "hexagonal")
        if self.kind != "file" and self.radius is None:
            yield "radius is missing; add it, for example radius = '0.1 um'"
        if self.kind not in ("grain", "file") and not regular and self.grains is None:
            yield f"grains is missing: how many does the {self.kind} have?"
        if regular and (self.shape is None or len(self.shape) != 3):
            yield "shape is missing: three whole numbers, such as [5, 5, 5]"
        if self.shape is not None and math.prod(self.shape) > MOST_GRAINS:
            yield f"shape = {self.shape} has more than {MOST_GRAINS:.0e} grains"

    def build(self, materials: dict[str, Material], seed: int) -> Grains:
        """Build the body. Raises BadInput."""
        if self.kind == "file":
            own = materials[self.material]
            one = own if "material" in self.model_fields_set else None
            return body_from_file(str(self.file), one, self.radius, self.length, materials, otherwise=own)
        names = ("radius", "moment", "moments", "magnetic", "dimension", "prefactor")
        given = {name: getattr(self, name) for name in names}
        return build(self.kind, self.grains, shape=self.shape, seed=seed, material=materials[self.material], **given)


def _offset(value: Any, name: str) -> Any:
    """Check an impact parameter.  Raises BadInput."""
    offset_of(value, 1.0, 1.0)
    return value


class ImpactSection(Section):
    """Section [impact]: relative motion, orientations and seeds."""

    speed: Annotated[Any, Number("m/s", above=0.0)]
    """Relative speed of the centres of mass [m/s]."""
    impact_parameter: Annotated[Any, Reading(_offset)] = 0.0
    """Impact parameter [m], or a fraction of the sum of the outer radii, "0.5 b", or of the characteristic radii
    √(5/3) r_g, "0.5 c"."""
    along: Literal["x", "y", "z"] = "x"
    """Direction of flight of the projectile."""
    turn: bool = True
    """Rotate both bodies at random, by the seed."""
    seeds: Seeds = Field(default_factory=lambda: [1])
    """One collision is run for each seed."""
    end: Annotated[Any, declared(Ending)["end"].setting] = "outcome"
    """`outcome`: when no two fragments can touch again and none is expected to break; `rest`: when contacts no longer
    change; or a time [s]."""
    frames: Annotated[int, declared(Ending)["frames"].setting] = FRAMES
    """Number of frames, and of rows of the ledger, until a collision usually ends, or until `end` if that is a time;
    each further doubling of the time adds half as many."""
    out: PathName | None = None
    """Folder of the results."""


class CollisionCase(Section):
    """Case file of `sand collide`."""

    target: BodySection
    projectile: BodySection
    impact: ImpactSection
    materials: dict[str, MaterialSection] = Field(default_factory=dict)
    forces: ForcesSection = ForcesSection()
    stepping: Stepping = Verlet()

    def materials_by_name(self) -> Library:
        """Presets and the materials of the case, by name."""
        return library_of(self.materials)

    def approach(self, seed: int) -> Approach:
        """Bodies of one collision; with `turn`, the seed determines random rotations. Raises BadInput."""
        materials = self.materials_by_name()
        return approach(
            self.target.build(materials, 2 * seed),
            self.projectile.build(materials, 2 * seed + 1),
            speed=self.impact.speed,
            impact_parameter=self.impact.impact_parameter,
            along=self.impact.along,
            seed=seed if self.impact.turn else None,
        )

    def ending(self) -> Ending:
        """When collisions end, and how often they are recorded."""
        return Ending(self.impact.end, self.impact.frames)

    def physics(self) -> tuple[list[Any] | None, Verlet]:
        """Forces and integrator, as `collision.prepare` and `collision.resume_collision` take them."""
        return self.forces.build() or None, self.stepping

    def check(self) -> Simulation:
        """Set up the first collision in memory, to find errors in the combination of bodies, forces and materials.

        Raises
        ------
        BadInput
            If there are errors.
        """
        return prepare(self.approach(self.impact.seeds[0]), *self.physics(), self.ending())

    def run(self, seed: int, **options: Any) -> tuple[Collision, Simulation]:
        """Simulate one collision; options are those of `Simulation`. Raises BadInput."""
        start = self.approach(seed)
        simulation = prepare(start, *self.physics(), **options)
        return run_to_end(start, simulation, self.ending()), simulation


def read_collision(path: str | Path) -> CollisionCase:
    """Read and check a case file of `sand collide`.

    Raises
    ------
    BadInput
        All errors of the file, one line each, with their keys.
    """
    content = read_content(path, "collide")
    problems = material_errors(content, ("target", "projectile"), "silica")
    return validate(with_integrator(CollisionCase, content), content, str(path), problems)


def run_seed(content: dict[str, Any], seed: int, observers: Sequence[Any] = ()) -> dict[str, Any]:
    """Simulate one collision of a case and return the outcome as a dictionary; runs in worker processes."""
    case = with_integrator(CollisionCase, content).model_validate(content)
    return case.run(seed, observers=list(observers))[0].to_dict()
