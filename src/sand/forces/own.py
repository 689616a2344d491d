"""Forces of the user: a formula with a decorator becomes a force for `sand.Simulation(forces=[…])`.

A run with such a force can be resumed: its case.toml names the force by its import path, `module:attribute`.  SAND
imports such a module only on request (`sand resume DIR --import MODULE`).
"""

from __future__ import annotations

import importlib
import inspect
import keyword
import os
import sys
from collections import namedtuple
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from ..basics.box import Box
from ..basics.descriptions import described
from ..basics.errors import BadInput, did_you_mean
from ..basics.grains import Grains
from ..basics.units import finite_number
from ..basics.vectors import components, three
from ..compiler.jit import compile_error, formula
from .external_formulas import GrainState
from .pair.generic_loops import PairGrain
from .pair.pair_force import PairForce, energy_at
from .registry import FORCES, column_of

IMPORT = "import"
"""Key of a table [forces.NAME] that holds the import path of a user's force."""
TAKEN = (IMPORT, "cutoff", "cut")
"""Keys of the tables of own forces that are not parameters of the user."""
OWN: dict[str, OwnForce] = {}
"""Forces that decorators have made in this process, by import path."""
SAMPLE = GrainState((1e-7, 2e-7, 3e-7), (1.0, 2.0, 3.0), (1e5, 2e5, 3e5), (1e-18, 2e-18, 3e-18), 1e-8, 1e-20, 1e-18)
"""Grain for which a formula is evaluated once, to see whether it works."""
SAMPLE_PAIR = tuple(PairGrain((1e-18, k * 1e-18, 3e-18), k * 1e-18, k * 1e-20, k * 1e-8) for k in (1.0, 2.0))
SEPARATION = (1e-7, 2e-7, 3e-7)


def external_force(name: str | None = None, /, **units: str) -> Any:
    """Decorator: a force on single grains from a formula of the user.

    The formula `f(grain, p)`, or `f(time, grain, p)` if the force depends on time, returns force [N] and energy [J], or
    force, torque [N m] and energy; p holds the parameters and is left out if there are none.  The force must be the
    gradient of the energy, F = −∂U/∂x.  `grain` has position, velocity, spin, moment, radius, mass and charge.

    Parameters
    ----------
    name : str, optional
        Name of the force, its ledger column and its table in case files; by default that of the function.
    units : str
        Unit of each parameter by name, "1" for a number: `stiffness="N/m"`.

    Returns
    -------
    callable
        The decorator; it returns a function that makes the force from values of the parameters.

    Raises
    ------
    BadInput
        If the formula or a name is invalid; one line with function, file and line.

    Examples
    --------
    >>> @sand.external_force(stiffness="N/m")
    ... def trap(grain, p):
    ...     x, y, z = grain.position
    ...     k = p.stiffness
    ...     return (-k * x, -k * y, -k * z), 0.5 * k * (x * x + y * y + z * z)
    >>> sim = sand.Simulation(grains, [sand.Contact(), trap(stiffness="1 nN/m")])
    """
    return _decorator(name, units, pair=False)


def pair_force(name: str | None = None, /, **units: str) -> Any:
    """Decorator: a force between all pairs of grains from a formula of the user.

    The formula `f(apart, a, b, p)` returns force on a [N] and energy [J], or force, torque on a, torque on b [N m] and
    energy; `apart` = x_a − x_b [m], a and b have moment, charge, mass and radius; p holds the parameters and is left
    out if there are none.  The force on b is the opposite one, and F = −∂U/∂x_a.  Cut-off, neighbour list, multiple
    time stepping and threads are those of all pair forces.

    Parameters
    ----------
    name : str, optional
        Name of the force, its ledger column and its table in case files; by default that of the function.
    units : str
        Unit of each parameter by name, "1" for a number: `strength="J"`.

    Returns
    -------
    callable
        The decorator; it returns a function that makes the force from values of the parameters, `cutoff` and `cut`.

    Raises
    ------
    BadInput
        If the formula or a name is invalid; one line with function, file and line.

    Examples
    --------
    >>> @sand.pair_force(strength="N m^2")
    ... def repulsion(apart, a, b, p):
    ...     x, y, z = apart
    ...     r = math.sqrt(x * x + y * y + z * z)
    ...     f = p.strength / r**3
    ...     return (f * x, f * y, f * z), p.strength / r
    >>> sim = sand.Simulation(grains, [repulsion(strength="1e-30 N m^2", cutoff="1 um")])
    """
    return _decorator(name, units, pair=True)


def _decorator(name: Any, units: dict[str, str], *, pair: bool) -> Any:
    if callable(name):  # without parentheses
        return OwnForce(name, None, units, pair=pair)
    return lambda function: OwnForce(function, name, units, pair=pair)


class OwnForce:
    """A kind of force that a decorator has made from a formula of the user; a call makes the force itself.

    Attributes
    ----------
    name : str
        Name of the force.
    function : callable
        The formula as the user wrote it.
    path : str
        Its import path, `module:attribute`.
    """

    def __init__(self, function: Callable, name: str | None, units: dict[str, str], *, pair: bool):
        self.name, self.function, self.units, self.pair = name or function.__name__, function, dict(units), pair
        self.path = f"{module_of(function)}:{function.__qualname__}"
        self.__doc__, self.__name__ = function.__doc__, function.__name__
        code = function.__code__
        self.where = f"force '{self.name}' ({Path(code.co_filename).name}:{code.co_firstlineno})"
        self._check_names()
        self.timed = self._has_time()
        self.constants = namedtuple("Parameters", self.units) if self.units else tuple
        self._formula: tuple[Callable, bool] | None = None
        self._compiles = False
        OWN[self.path] = self

    def __repr__(self) -> str:
        return f"<{self.where}, {self.path}>"

    def __call__(self, /, **values: Any) -> OwnExternal | OwnPair:
        """Make the force from values of its parameters: SI numbers, text with a unit, or three of these."""
        options = {key: values.pop(key) for key in ("cutoff", "cut") if self.pair and key in values}
        allowed = [*self.units, *(("cutoff", "cut") if self.pair else ())]
        problems = [
            f"{self.name}: there is no parameter '{key}'; {did_you_mean(key, allowed or ['none'])}"
            for key in values
            if key not in self.units
        ]
        read: dict[str, Any] = {}
        for key, unit in self.units.items():
            if key not in values:
                problems.append(f"{self.name}: {key} is missing; add {key}=… in {unit}")
                continue
            label = f"{self.name}: {key}"
            try:
                if components(values[key]) is None:
                    read[key] = finite_number(values[key], unit, label)
                else:
                    read[key] = three(values[key], unit, label, read=finite_number)
            except BadInput as error:
                problems += error.problems
        if problems:
            raise BadInput(problems)
        return OwnPair(self, read, **options) if self.pair else OwnExternal(self, read)

    def _check_names(self) -> None:
        problems = []
        if not self.name.isidentifier() or keyword.iskeyword(self.name):
            problems.append(f"{self.where}: the name must be a word of letters, digits and _")
        if self.name in FORCES or self.name in {column_of(force) for force in FORCES.values()}:
            problems.append(f"{self.where}: SAND has a force or ledger column of this name; choose another one")
        for key, unit in self.units.items():
            if key in TAKEN or keyword.iskeyword(key) or key.startswith("_"):
                problems.append(f"{self.where}: a parameter cannot be called '{key}'; choose another name")
            elif not isinstance(unit, str):
                problems.append(f'{self.where}: {key} = {unit!r} must be the unit of this parameter, such as "N/m"')
        if problems:
            raise BadInput(problems)

    def _has_time(self) -> bool:
        """Whether the formula takes the time; raises BadInput if its arguments do not fit."""
        given = len(inspect.signature(self.function).parameters)
        last = ["p"] if self.units else []
        forms = [["apart", "a", "b", *last]] if self.pair else [["grain", *last], ["time", "grain", *last]]
        if given not in map(len, forms):
            calls = " or ".join(f"{self.name}({', '.join(form)})" for form in forms)
            raise BadInput(f"{self.where}: the formula takes {given} arguments; it must be {calls}")
        return not self.pair and given == len(forms[1])

    def formula(self, constants: Any) -> tuple[Callable, bool]:
        """The formula as the loops call it, and whether it has torques.  Raises BadInput if it does not work."""
        if self._formula is None:
            torques = self._try(constants)
            wrap = _pair_formula if self.pair else _external_formula
            self._formula = wrap(formula(self.function), self.timed, bool(self.units), torques), torques
        return self._formula

    def _arguments(self, constants: Any) -> list[Any]:
        """Arguments of the user's formula for one evaluation."""
        grains: list[Any] = [SEPARATION, *SAMPLE_PAIR] if self.pair else [SAMPLE]
        return [*([0.0] if self.timed else []), *grains, *([constants] if self.units else [])]

    def _try(self, constants: Any) -> bool:
        """Evaluate the formula once, as Python; returns whether it has torques.  Raises BadInput."""
        try:
            result = self.function(*self._arguments(constants))
        except Exception as error:
            raise BadInput(f"{self.where}: the formula fails for a test grain: {_in_words(error)}") from None
        vectors = ("force", "torque on a", "torque on b") if self.pair else ("force", "torque")
        if not isinstance(result, tuple) or len(result) not in (2, len(vectors) + 1):
            given = f"{len(result)} values" if isinstance(result, tuple) else f"a {type(result).__name__}"
            raise BadInput(
                f"{self.where}: the formula returns {given}; it must return force, energy "
                f"or {', '.join(vectors)}, energy"
            )
        for value, what in zip(result[:-1], vectors, strict=False):
            if not isinstance(value, tuple) or len(value) != 3 or not all(_is_number(x) for x in value):
                raise BadInput(f"{self.where}: the {what} is {value!r}; it must be a tuple of three numbers")
        if not _is_number(result[-1]):
            raise BadInput(f"{self.where}: the energy, the last value, is {result[-1]!r}; it must be a number")
        return len(result) > 2

    def check(self, constants: Any) -> None:
        """Compile the formula alone.  Raises BadInput if numba cannot compile it."""
        if not self._compiles:
            if error := compile_error(self.function, self._arguments(constants)):
                advice = "; functions that it calls need the decorator numba.njit" if "Untyped global" in error else ""
                raise BadInput(f"{self.where}: numba cannot compile the formula: {error}{advice}")
            self._compiles = True


class _Own:
    """What external and pair forces of the user have in common."""

    def __init__(self, kind: OwnForce, values: dict[str, Any]):
        self.kind, self.name, self.values = kind, kind.name, values
        self.references = f"user-defined: {kind.path}"
        self.formula, self.torques = kind.formula(self.constants())

    __repr__ = described

    @property
    def units(self) -> dict[str, str]:
        """Units of the parameters."""
        return {**self.kind.units, "cutoff": "m"}

    def constants(self) -> Any:
        """The parameters of the formula."""
        return self.kind.constants(**self.values) if self.values else ()

    def parameters(self) -> dict[str, Any]:
        """Import path and values in SI units, as in a case file."""
        lists = {key: list(value) if isinstance(value, tuple) else value for key, value in self.values.items()}
        return {IMPORT: self.kind.path, **lists}


class OwnExternal(_Own):
    """An external force of the user; see `external_force`."""

    position_dependent = True

    @property
    def time_dependent(self) -> bool:
        """Whether the formula takes the time."""
        return self.kind.timed

    def check(self, grains: Grains, box: Box) -> list[str]:
        """No warnings.  Raises BadInput if the formula cannot be compiled."""
        self.kind.check(self.constants())
        return []

    def numbers(self) -> Any:
        """Parameters of the formula."""
        return self.constants()

    def flux_density_size(self) -> float:
        """0: the step is not limited by a magnetic field."""
        return 0.0


class OwnPair(_Own, PairForce):
    """A pair force of the user; see `pair_force`."""

    def __init__(self, kind: OwnForce, values: dict[str, Any], cutoff: Any = "auto", cut: str = "smooth"):
        self.cutoff, self.cut, self.name = cutoff, cut, kind.name
        self.__post_init__()
        super().__init__(kind, values)
        self.column = kind.name

    def parameters(self) -> dict[str, Any]:
        """Import path, values in SI units and cut-off, as in a case file."""
        return _Own.parameters(self) | PairForce.parameters(self)

    def check(self, grains: Grains, box: Box) -> list[str]:
        """Warnings as for all cut-offs.  Raises BadInput if the formula cannot be compiled."""
        self.kind.check(self.constants())
        return PairForce.check(self, grains, box)

    def acts_on(self, grains: Grains) -> bool:
        """True: the formula decides."""
        return True

    def largest_energy(self, grains: Grains, distance: float) -> float:
        """Largest |U| [J] of two grains at a distance [m], without the cut-off."""
        return energy_at(self.formula, self.constants(), grains, distance)


def own_force(table: dict[str, Any]) -> OwnExternal | OwnPair:
    """The force that a table with an import path describes; nothing is imported.

    Raises
    ------
    BadInput
        If no decorator has made this force in this process, or its parameters are invalid.
    """
    path = table[IMPORT]
    module, colon, attribute = path.partition(":") if isinstance(path, str) else ("", "", "")
    if not (module and colon and attribute):
        raise BadInput(f"import = {path!r} must be the place of a force of your own, 'module:function'")
    if path not in OWN:
        if module in sys.modules:
            raise BadInput(f"import = '{path}': module {module} has no force '{attribute}'")
        raise BadInput(
            f"import = '{path}': SAND imports no modules on its own; add --import {module}, "
            f'in Python sand.resume(…, imports=["{module}"])'
        )
    return OWN[path](**{key: value for key, value in table.items() if key != IMPORT})


IMPORTED: list[str] = []
"""Modules that `import_modules` imported, as it takes them, for other processes."""


def import_modules(names: Iterable[str]) -> None:
    """Import modules that define forces, by name or file; the present folder is searched first.

    Raises
    ------
    BadInput
        If a module cannot be imported.
    """
    for given in [names] if isinstance(names, str) else names:
        name = os.path.expanduser(given)
        folder, module = ("", name) if not name.endswith(".py") else (str(Path(name).parent), Path(name).stem)
        sys.path.insert(0, str(Path(folder).absolute()))
        try:
            importlib.import_module(module)
        except Exception as error:
            raise BadInput(f"--import {name}: {_in_words(error)}") from None
        finally:
            sys.path.pop(0)
        IMPORTED.append(str(Path(name).absolute()) if name.endswith(".py") else name)


def module_of(function: Callable) -> str:
    """Name of the module of a function; for a script that of its file, under which it can be imported."""
    if function.__module__ != "__main__":
        return function.__module__
    main = sys.modules["__main__"]
    spec, file = getattr(main, "__spec__", None), getattr(main, "__file__", None)
    return str(spec.name) if spec is not None else Path(file).stem if file else "__main__"


def _in_words(error: Exception) -> str:
    return f"{type(error).__name__}: {' '.join(str(error).split())}"


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _external_formula(function: Callable, timed: bool, has_parameters: bool, torques: bool) -> Callable:
    """`function` with the arguments (time, grain, parameters) and the results force, torque, energy."""

    def with_both(time, grain, parameters):
        return function(time, grain, parameters)

    def with_time(time, grain, parameters):
        return function(time, grain)

    def with_parameters(time, grain, parameters):
        return function(grain, parameters)

    def with_grain(time, grain, parameters):
        return function(grain)

    own = with_both if timed and has_parameters else with_time if timed else with_parameters
    call = _of_user(own if timed or has_parameters else with_grain, function)

    def without_torque(time, grain, parameters):
        force, energy = call(time, grain, parameters)
        return _floats(force), (0.0, 0.0, 0.0), float(energy)

    def with_torque(time, grain, parameters):
        force, torque, energy = call(time, grain, parameters)
        return _floats(force), _floats(torque), float(energy)

    return _of_user(with_torque if torques else without_torque, function)


def _pair_formula(function: Callable, timed: bool, has_parameters: bool, torques: bool) -> Callable:
    """`function` with the arguments (apart, a, b, parameters) and floats as results."""

    def with_parameters(apart, a, b, parameters):
        return function(apart, a, b, parameters)

    def with_grains(apart, a, b, parameters):
        return function(apart, a, b)

    call = _of_user(with_parameters if has_parameters else with_grains, function)

    def without_torque(apart, a, b, parameters):
        force, energy = call(apart, a, b, parameters)
        return _floats(force), float(energy)

    def with_torque(apart, a, b, parameters):
        force, torque_a, torque_b, energy = call(apart, a, b, parameters)
        return _floats(force), _floats(torque_a), _floats(torque_b), float(energy)

    return _of_user(with_torque if torques else without_torque, function)


@formula
def _floats(v):
    return float(v[0]), float(v[1]), float(v[2])


def _of_user(wrapper: Callable, function: Callable) -> Callable:
    """Decorate a wrapper as a formula of the user's module."""
    wrapper.__module__ = function.__module__
    return formula(wrapper)
