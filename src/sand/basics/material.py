"""Materials of grains, and presets with values from the literature."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Set
from dataclasses import dataclass
from types import MappingProxyType
from typing import Annotated, Any, NamedTuple

from .arguments import checked
from .errors import BadInput, did_you_mean, shown
from .settings import Number, Settings, Word


@checked
@dataclass(frozen=True)
class Material(Settings):
    """Properties of one material. Numbers are in SI or text with a unit.

    Parameters
    ----------
    name : str
        Name in case files and tables.
    density : float or str
        Density ρ [kg/m³] > 0.
    surface_energy : float or str or None
        Energy γ of one free surface [J/m²] ≥ 0. None if there is no recommended value; a contact of such grains raises
        BadInput.
    young_modulus : float or str
        Young's modulus E [Pa] > 0.
    poisson_ratio : float or str
        Poisson's ratio ν, −1 < ν ≤ 0.5.
    rolling_limit : float or str, optional
        Critical rolling displacement ξ_c [m] > 0, 10 Å by default (Dominik & Nübold 2002, A.5).
    specific_moment : float or str, optional
        Magnetic moment per mass [A m²/kg] ≥ 0, at saturation.
    anisotropy : float or str, optional
        Magnetic anisotropy K [J/m³]: of a uniaxial grain > 0, or the first cubic constant K₁ ≠ 0 of a cubic crystal. No
        force depends on it or on the next two: with them SAND reports where moments fixed in the grains are no good
        model (`sand.theory.magnetic_limits`).
    exchange_stiffness : float or str, optional
        Exchange stiffness A [J/m] > 0.
    anisotropy_kind : str, optional
        "uniaxial", energy per volume −K cos²θ from one easy axis: of a hexagonal crystal, or of an elongated grain with
        its effective K. "cubic", K₁ (α₁²α₂² + α₂²α₃² + α₃²α₁²) with the direction cosines α: a round grain of a cubic
        crystal.

    Raises
    ------
    BadInput
        If numbers are invalid; one line for each.
    """

    name: str
    density: Annotated[Any, Number("kg/m^3", above=0.0)]
    surface_energy: Annotated[Any, Number("J/m^2", least=0.0, none=True)]
    young_modulus: Annotated[Any, Number("Pa", above=0.0)]
    poisson_ratio: Annotated[Any, Number(above=-1.0, most=0.5)]
    rolling_limit: Annotated[Any, Number("m", above=0.0)] = "10 angstrom"
    specific_moment: Annotated[Any, Number("A m^2/kg", least=0.0)] = 0.0
    anisotropy: Annotated[Any, Number("J/m^3")] = None
    exchange_stiffness: Annotated[Any, Number("J/m", above=0.0)] = None
    anisotropy_kind: Annotated[str, Word("uniaxial", "cubic")] = "uniaxial"

    def contradictions(self, wrong: Set[str]) -> Iterator[str]:
        """A K that the kind of anisotropy does not allow."""
        k, kind = self.anisotropy, self.anisotropy_kind
        if k is None or wrong & {"anisotropy", "anisotropy_kind"}:
            return
        if k == 0.0 or (k < 0.0 and kind == "uniaxial"):
            allowed = "must be above 0 J/m^3" if kind == "uniaxial" else "must not be 0 J/m^3"
            cubic = "; K1 of a cubic crystal may be negative: anisotropy_kind = 'cubic'" if k < 0.0 else ""
            yield f"anisotropy = {k:g} {allowed} if it is {kind}{cubic}"

    @property
    def shear_modulus(self) -> float:
        """Shear modulus G = E / (2 (1 + ν)) [Pa]."""
        return float(self.young_modulus / (2.0 * (1.0 + self.poisson_ratio)))

    def but(self, **changes: Any) -> Material:
        """Return a copy with some values changed: `sand.IRON.but(surface_energy="1 J/m^2")`."""
        known = [f.name for f in dataclasses.fields(self)]
        for key in changes:
            if key not in known:
                raise BadInput(f"a material has no '{key}'; {did_you_mean(key, known)}")
        return dataclasses.replace(self, **changes)

    @classmethod
    @checked
    def like(cls, preset: str, **changes: Any) -> Material:
        """Return the material of a preset, with some values changed.

        Parameters
        ----------
        preset : str
            Name of a preset, such as "iron" or "ice (Wada et al. 2013)"; case is ignored.
        changes
            Arguments of `Material` that differ from the preset, such as `name` and `surface_energy`.

        Raises
        ------
        BadInput
            If there is no such preset, or no such argument.
        """
        return material_named(preset).but(**changes)


# Sources: DT97 = Dominik & Tielens 1997; Wada et al. 2007; the paper = Dominik & Nübold 2002.
ICE = Material("ice", 1000.0, 0.10, 7.0e9, 0.25, rolling_limit=8e-10)
"""Water ice, γ after Wada et al. (2007); DT97 use 0.37 J/m²."""
SILICA = Material("silica", 2650.0, 0.025, 54.0e9, 0.17)
"""Quartz or silica glass (DT97)."""
GRAPHITE = Material("graphite", 2200.0, 0.075, 10.0e9, 0.32)
"""Graphite (DT97)."""
FORSTERITE = Material("forsterite", 3210.0, 0.07, 204.0e9, 0.24)
"""Forsterite."""
IRON = Material("iron", 7874.0, 3.0, 210.0e9, 0.27, "10 angstrom", 200.0, 4.8e4, 2e-11, "cubic")
"""Iron (DT97), 200 A m²/kg as in the paper. K₁ (cubic) and A at room temperature are recalled from the literature, not
read at the source: check them before you rely on the limits that follow."""
MAGNETITE = Material("magnetite", 5200.0, None, 230.0e9, 0.26, "10 angstrom", 92.0, -1.1e4, 1.2e-11, "cubic")
"""Magnetite at saturation, without a surface energy; set one with `MAGNETITE.but(surface_energy=…)`. K₁ (cubic) and A
at room temperature are recalled from the literature, as for iron."""

COMMON = {m.name: m for m in (ICE, SILICA, GRAPHITE, FORSTERITE, IRON, MAGNETITE)}
COMMON["quartz"] = SILICA.but(name="quartz")


class PaperPreset(NamedTuple):
    """The material of a paper, and what the paper changed in the contact model.

    The numbers were not checked in the paper, unless `read` says so.
    """

    material: Material  # its name is that of the preset
    radius: float  # of the grains [m]
    contact: dict[str, Any]  # settings of `sand.Contact` that are not the default
    source: str
    read: str  # what was read in the paper, or in another source


_MEMORY = "from memory"
_ABSTRACT = "abstract; numbers from memory"
_ICE, _SILICA = (0.1, 7.0e9, 0.25), (0.025, 54.0e9, 0.17)  # γ [J/m²], E [Pa], ν


def _paper(
    name: str,
    density: float,
    solid: tuple[float, float, float],
    rolling_limit: float,
    source: str,
    read: str = _MEMORY,
    *,
    radius: float = 1e-7,
    **contact: Any,
) -> PaperPreset:
    """A preset; density ρ [kg/m³], γ, E and ν, ξ_c [m], radius [m]."""
    return PaperPreset(Material(name, density, *solid, rolling_limit), radius, contact, source, read)


_DT97, _W07, _W08 = "ApJ 480, 647", "ApJ 661, 320, doi:10.1086/514332", "ApJ 677, 1296"
_W09, _W13, _K13 = "ApJ 702, 1490", "A&A 559, A62", "A&A 554, A4"
_S12, _T19 = "A&A 541, A59, arXiv:1203.3630", "ApJ 874, 159, arXiv:1902.08356"
_T23, _A22 = "ApJ 953, 6, arXiv:2306.09259", "ApJ 939, 100, arXiv:2210.00913"
_PROGRAM = "abstract; material and factors: Silicate.mat of the public program of the first author"
PAPERS = (
    _paper("ice (Dominik & Tielens 1997)", 1000.0, (0.37, 7.0e9, 0.25), 2e-10, _DT97, stiffness="dt97"),
    _paper("quartz (Dominik & Tielens 1997)", 2600.0, _SILICA, 2e-10, _DT97, stiffness="dt97"),
    _paper("ice (Wada et al. 2007)", 1000.0, _ICE, 2e-10, _W07, _ABSTRACT),
    _paper("quartz (Wada et al. 2007)", 2600.0, _SILICA, 2e-10, _W07, _ABSTRACT),
    _paper("ice (Wada et al. 2008)", 1000.0, _ICE, 8e-10, _W08),
    _paper("ice (Wada et al. 2009)", 1000.0, _ICE, 8e-10, _W09),
    _paper("silica (Wada et al. 2009)", 2600.0, _SILICA, 20e-10, _W09),
    _paper(
        "silica (Seizinger et al. 2012)",
        2650.0,
        (0.02, 54.0e9, 0.17),
        20e-10,
        _S12,
        _PROGRAM,
        radius=6e-7,
        roll_factor=8.0,
        slide_factor=2.5,
    ),
    _paper("ice (Wada et al. 2013)", 1000.0, _ICE, 8e-10, _W13),
    _paper("silica (Wada et al. 2013)", 2600.0, _SILICA, 20e-10, _W13),
    _paper("ice (Kataoka et al. 2013)", 1000.0, _ICE, 8e-10, _K13, _ABSTRACT),
    _paper("ice (Tatsuuma et al. 2019)", 1000.0, _ICE, 8e-10, _T19, _ABSTRACT),
    _paper("silicate (Tatsuuma et al. 2019)", 2650.0, (0.02, 54.0e9, 0.17), 20e-10, _T19, _ABSTRACT),
    _paper("ice (Arakawa et al. 2022)", 1000.0, _ICE, 8e-10, _A22, _ABSTRACT),
    _paper("ice (Tatsuuma et al. 2023)", 1000.0, _ICE, 8e-10, _T23, _ABSTRACT),
    _paper("silicate (Tatsuuma et al. 2023)", 2650.0, (0.02, 54.0e9, 0.17), 20e-10, _T23, _ABSTRACT),
)
"""Materials of papers; the table with E_roll and E_break is `sand.theory.paper_table`."""


class Library(dict[str, Any]):
    """Presets and further materials by names that users give: case is ignored where no name has the same.

    A name that SAND has written into a file is exact, and looked up in `dict(library)`.
    """

    def __init__(self, own: Mapping[str, Any] = MappingProxyType({})):
        super().__init__(COMMON | {p.material.name: p.material for p in PAPERS} | dict(own))
        self._similar = dict[str, list[str]]()
        for name in self:
            self._similar.setdefault(name.lower(), []).append(name)

    def __contains__(self, name: object) -> bool:
        return super().__contains__(name) or (isinstance(name, str) and name.lower() in self._similar)

    def __missing__(self, name: str) -> Any:
        """Raises BadInput for an unknown name, with the nearest ones, and where several differ from it in case only."""
        similar = self._similar.get(str(name).lower(), [])
        if not similar:
            raise BadInput(f"unknown material '{name}'; {did_you_mean(str(name), list(self), NEAREST)}")
        if len(similar) > 1:
            raise BadInput(f"material '{name}' is not unique; give {' or '.join(map(repr, similar))}")
        return self[similar[0]]


PRESETS = Library()
NEAREST = 3
"""Names that a message about an unknown preset shows."""

LIKE = (
    'Paper whose settings are taken: the name of its material, such as "silica (Seizinger et al. 2012)", which has '
    "roll_factor = 8 and slide_factor = 2.5; keys beside it override. Materials are chosen in [materials]."
)
"""Meaning of the key `like` of [forces.contact]."""


def material_named(name: str) -> Material:
    """Look up a preset by name (case ignored). Raises BadInput that shows the nearest names."""
    return PRESETS[name]


def contact_settings(preset: str) -> dict[str, Any]:
    """Settings of `sand.Contact` in a paper, by the name of its preset (case ignored).

    Raises BadInput that shows the nearest names.
    """
    for paper in PAPERS:
        if paper.material.name.lower() == preset.lower():
            return dict(paper.contact)
    names = [paper.material.name for paper in PAPERS]
    raise BadInput(f"there are no contact settings of '{preset}'; {did_you_mean(preset, names, NEAREST)}")


def listed_presets() -> str:
    """Names of presets for messages and comments; of those of papers one, as an example."""
    return f"{', '.join(COMMON)}, or of a paper, such as '{PAPERS[-1].material.name}' (docs: Materials)"


def like_preset(preset: str, name: str) -> Material:
    """Look up the preset from which a material `name` is derived. Raises BadInput if `name` is a different preset."""
    found = material_named(preset)
    if {known.lower(): known for known in PRESETS}.get(name.lower(), found.name) != found.name:
        raise BadInput(f"'{name}' is the name of a preset, but like = '{preset}'; choose another name")
    return found


def as_material(given: Any, name: str = "material") -> Material:
    """Convert a Material or the name of a preset to a Material. Raises BadInput."""
    found = material_named(given) if isinstance(given, str) else given
    if not isinstance(found, Material):
        raise BadInput(f"{name} = {shown(given)}; give a sand.Material or the name of a preset: {listed_presets()}")
    return found
