"""`sand methods`: the paragraph has the numbers that are stored in the folder, for every kind of folder."""

import json
import re
import tomllib

import pytest
import tomli_w

import sand
from sand.basics.version import __version__
from sand.cli.main import main
from sand.cli.method_text import SYMBOLS, latex, plain, settings
from sand.cli.methods import KINDS
from sand.cli.references import ARTICLES
from sand.config.commands import OWN_TABLES
from sand.forces.registry import FORCES
from sand.io.bodies import write_body
from sand.io.damage import sealed

from .test_cite import entries
from .test_commands import COLLIDE, GROW, RUN, SCATTER

CONTACT = """
[forces.contact]
like = "silica (Seizinger et al. 2012)"
damping = "critical"
damping_ratio = 0.37
[forces.gravity]
acceleration = [0, 0, "-9.81 m/s^2"]
"""
SUMMARY = {"sand": "0.0.7", "versions": {"numpy": "9.9"}, "steps": 4000, "time": 2e-8, "grains": 8, "drift": 1.5e-5}


def folder_of(place, case, results, comment="the complete case"):
    """A folder as a run or job leaves it: the case and results by file name."""
    place.mkdir()
    (place / "case.toml").write_text(f"# Written by SAND: {comment}\n\n{tomli_w.dumps(tomllib.loads(case))}", "utf-8")
    for name, content in results.items():
        (place / name).parent.mkdir(exist_ok=True)
        written = sealed(content) if name.endswith("summary.json") and isinstance(content, dict) else content
        (place / name).write_text(written if isinstance(written, str) else json.dumps(written), "utf-8")
    return place


FOLDERS = {
    "run": (RUN + 'material = "ice (Wada et al. 2013)"\ntemperature = "77 K"\n' + CONTACT, {"summary.json": SUMMARY}),
    "collide": (
        COLLIDE.replace('kind = "chain"', 'kind = "chain"\nmaterial = "iron"') + CONTACT,
        {"collision.json": {"collisions": [{}, {}], "sand": "0.0.7"}},
    ),
    "grow": (GROW + CONTACT, {f"seed-{k}/summary.json": SUMMARY for k in (1, 2)} | {"growth.json": {}}),
    "scatter": (SCATTER, {"scattering.json": {"job": "cross-section", "sand": "0.0.7"}}),
    "stretch": (
        '[aggregate]\nkind = "rbd"\ngrains = 30\nradius = "0.1 um"\nmaterial = "iron"\n[stretch]\nrate = "2 m/s"\n'
        f'to = 0.5\nby = "walls"\nseeds = [1, 2, 3]\n{CONTACT}',
        {"laboratory.json": {"runs": [{}, {}], "sand": "0.0.7"}},
    ),
    "sweep": (
        COLLIDE + '[sweep.vary]\n"impact.speed" = [2, 4]' + CONTACT,
        {
            "sweep.json": {},
            "sweep.csv": "impact.speed,seed,state,f,message,seconds,cpu_seconds,version,run\n"
            "2.0,5,done,1,,1,1,0.0.7,a\n4.0,5,failed,,no,1,1,0.0.7,b\n",
        },
    ),
}
EXPECTED = {
    "run": [
        "8 grains, a gas: radius = 10 nm",
        "temperature = 77 K",
        "density = 1000 kg/m^3, surface energy = 0.1 J/m^2, Young's modulus = 7 GPa, Poisson's ratio = 0.25, "
        "critical rolling displacement = 800 pm; these are the numbers of the preset ice (Wada et al. 2013)",
        "periodic 400 nm x 400 nm x 400 nm",
        "4000 steps cover 20 ns, 5 ps each on average",
        "until = 20 ns. Random numbers have the seed 0",
        "was 1.5e-05 of",
        "numpy 9.9",
    ],
    "collide": [
        "The target was: kind = chain, grains = 3, radius = 100 nm, material = iron",
        "The projectile was: kind = grain, radius = 100 nm, material = silica",
        "speed = 2 m/s, impact parameter = 0 m, along = x, turn = yes",
        "for the seeds 1, 2 of aggregates and orientations; 2 are finished",
        "density = 7874 kg/m^3",
        "density = 2650 kg/m^3",
    ],
    "grow": ["seeds 1, 2", "8 grains, a gas", "2 boxes have run", "was 1.5e-05 of"],
    "stretch": [
        "seeds 1 to 3; 2 of 3 runs are finished",
        "The packing was: kind = rbd, grains = 30, radius = 100 nm, material = iron",
        "to = 0.5, by = walls, along = auto",
        "density = 7874 kg/m^3",
    ],
    "sweep": [
        "A sweep of sand collide varied impact.speed = (2, 4), seed = (5) (SI units); 1 of 2 runs are done, 1 failed.",
        "The target was: kind = chain, grains = 3, radius = 100 nm, material = silica",
        "speed = 2 m/s",
    ],
    "scatter": [
        "The projectile was: kind = grain, radius = 10 nm, material = iron, moment = 200 A m^2/kg",
        "speed = 1 m/s, temperature = 100 K",
        "relative error = 0.02, seed = 0",
        "tolerance = 1e-08",
        "density = 7874 kg/m^3",
    ],
}
for _table, _kind in (("compression", "compress"), ("shear", "shear")):
    _case, _results = FOLDERS["stretch"]
    FOLDERS[_kind], EXPECTED[_kind] = (_case.replace("[stretch]", f"[{_table}]"), _results), EXPECTED["stretch"]
NOTHING = "holds nothing that was computed by sand run, collide, grow, scatter,"
_case, _results = FOLDERS["stretch"]
_elastic = _case.partition("[stretch]")[0] + f"[elastic]\ncompress_to = 0.5\nseeds = [1, 2, 3]\n{CONTACT}"
FOLDERS["elastic"] = _elastic, _results
EXPECTED["elastic"] = [*EXPECTED["stretch"][:2], "compress to = 0.5", "density = 7874 kg/m^3"]
OF_FORCES = [
    "the JKR law (Johnson et al. 1971), with critical damping",
    "slide factor = 2.5, roll factor = 8",
    "damping ratio = 0.37",
    "A further force is gravity (Newton 1687): acceleration = (0 m/s^2, 0 m/s^2, -9.81 m/s^2)",
    "steps per period = 25",
]


@pytest.mark.parametrize("kind", list(FOLDERS))
def test_each_kind_of_folder(kind, tmp_path, capsys):
    """Each number of the case and the version of the results are in the text; there is a line for each article."""
    assert main(["methods", str(folder_of(tmp_path / "x", *FOLDERS[kind]))]) == 0
    text, *cited = capsys.readouterr().out.splitlines()
    assert "version 0.0.7 (The SAND developers; Dominik & Nübold 2002)" in text
    for part in EXPECTED[kind] + (OF_FORCES if kind != "scatter" else []):
        assert part in text
    assert "None" not in text and "⟦" not in text
    assert len(cited) == (3 if kind != "scatter" else 1)
    assert all(line.strip() in [one.text() for one in ARTICLES] for line in cited)


def test_a_sweep_of_sequential_collisions(tmp_path, capsys):
    """There is one body; no run has ended."""
    case = "[target]\nkind = 'chain'\ngrains = 2\nradius = '1 um'\n[impact]\nspeed = '3 m/s'\n"
    case += "[sequence]\ncollisions = 4\n[sweep]\nseeds = 2"
    assert main(["methods", str(folder_of(tmp_path / "x", case, {}))]) == 0
    text = capsys.readouterr().out
    assert "A sweep of sequential collisions varied seed = (1, 2) (SI units); 0 of 2 runs are done, 2 left." in text
    assert "The target was: kind = chain, grains = 2" in text and "projectile" not in text
    assert "It collided with a copy of itself, and so did what grew from it: collisions = 4." in text


def test_all_commands_that_fill_folders():
    """A command with tables of its own in case files is described, or refused in one line (below)."""
    assert set(KINDS) <= set(OWN_TABLES)
    assert set(KINDS) == set(FOLDERS)


def test_a_run_that_has_not_ended(tmp_path, capsys):
    """There is no summary: the version is not known, and the text says so."""
    place = folder_of(tmp_path / "x", FOLDERS["run"][0], {})
    assert main(["methods", str(place)]) == 0
    text = capsys.readouterr().out
    assert "of a version that the folder does not name" in text
    assert "The run has not ended." in text
    assert __version__ not in text


def test_versions_of_results(tmp_path):
    """Results of jobs name the version that computed them."""
    from sand.experiments.job import Job

    class Nothing(Job):
        COMMAND, RESULTS = "collide", "collision.json"

        def compute(self, *_):
            return {"collisions": []}

    (tmp_path / "a.toml").write_text(COLLIDE, "utf-8")
    Nothing(tmp_path / "a.toml", tmp_path / "out").run()
    assert json.loads((tmp_path / "out" / "collision.json").read_text("utf-8"))["sand"] == __version__


@pytest.mark.parametrize("kind", list(FOLDERS))
def test_latex_and_bibtex(kind, tmp_path, capsys):
    """LaTeX is ASCII with balanced braces and dollars; its keys are those of --bibtex."""
    place = str(folder_of(tmp_path / "x", *FOLDERS[kind]))
    assert main(["methods", place, "--latex"]) == 0
    text = capsys.readouterr().out
    assert text.isascii() and "?" not in text
    assert text.count("{") - text.count(r"\{") == text.count("}") - text.count(r"\}")
    assert (text.count("$") - text.count(r"\$")) % 2 == 0
    assert not re.search(r"(?<!\\)[_%#&^](?!{)", text)
    keys = {key for found in re.findall(r"\\citep\{(.*?)\}", text) for key in found.split(",")}
    assert main(["methods", place, "--bibtex"]) == 0
    found = entries(capsys.readouterr().out)
    assert {key for _, key, _ in found} == keys
    assert "0.0.7" in next(fields["note"] for _, key, fields in found if key == "SAND")
    assert main(["methods", place, "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["latex"] == text.rstrip("\n")
    assert [one["reference"] for one in content["references"]] == [one.text() for one in ARTICLES if one.key in keys]


def test_powers_and_symbols():
    """Powers become superscripts, powers of ten products; each symbol is replaced."""
    assert latex("9 kg/m^3, 2.5e-08 J, 1e+03") == r"9 kg/m$^{3}$, 2.5$\times$10$^{-8}$ J, 1$\times$10$^{3}$"
    assert latex("".join(SYMBOLS)) == "".join(SYMBOLS.values())
    assert latex("a ⟦SAND⟧") == r"a \citep{SAND}" and plain("a ⟦SAND⟧") == "a (The SAND developers)"


def test_settings_of_every_force():
    """Every force with its defaults has a text, and every number in it the unit of its declaration."""
    given = {"gas": {"temperature": 100, "density": 1e-6}, "contact": {"damping": "critical"}}
    made = 0
    for name, force in FORCES.items():
        try:
            one = force(**given.get(name, {}))
        except sand.BadInput:
            continue  # a force that needs arguments
        text = settings(one)
        for key, unit in one.units.items():
            if isinstance(value := one.parameters().get(key), float):
                number, _, given_unit = re.search(rf"{key.replace('_', ' ')} = (\S+)( (\S.*?))?(, |$)", text).groups()[
                    :3
                ]
                assert sand.basics.units.si(f"{number} {given_unit}".replace("µ", "u"), unit, key) == value
                made += 1
    assert made
    ramp = settings(sand.Field(sand.Ramp([0, "1 mT"], [0, "1 us"])))
    assert ramp == "flux density = (values = ((0 T, 0 T, 0 T), (0 T, 0 T, 1 mT)), times = (0 s, 1 µs), steps = 1000)"


@pytest.mark.parametrize(
    ("make", "line"),
    [
        (lambda place: place / "none", "there is no folder"),
        (
            lambda place: place,
            f"{NOTHING} compress, stretch, shear, elastic, sweep",
        ),
        (
            lambda place: (place / "case.toml").write_text(RUN, "utf-8") and place,
            f"{NOTHING} compress, stretch, shear, elastic, sweep",
        ),
        (
            lambda place: folder_of(place / "x", "[sweep]\nseeds = 1", {}),
            "is no case that a sweep can vary",
        ),
        (lambda place: folder_of(place / "x", RUN, {"summary.json": [1]}), "summary.json"),
    ],
)
def test_other_folders(make, line, tmp_path, capsys):
    """One line for a folder that is not there, is no folder of SAND, has not begun, or is damaged."""
    assert main(["methods", str(make(tmp_path))]) == 2
    (found,) = capsys.readouterr().err.splitlines()
    assert line in found


def test_latex_or_bibtex(tmp_path, capsys):
    """Two forms at once are refused."""
    assert main(["methods", str(tmp_path), "--latex", "--bibtex"]) == 2
    assert "--latex and --bibtex exclude each other" in capsys.readouterr().err


@pytest.mark.compiled("dipoles")
def test_a_finished_run(finished_run, capsys):
    """A run from a script: radii of the first frame, numbers of the field and the moment of the material."""
    assert main(["methods", str(finished_run[0])]) == 0
    text = capsys.readouterr().out
    for part in (
        "6 grains of radius 10 nm, placed by a script",
        "magnetic moment per mass = 200 A m^2/kg",
        "A further force is field",
        "frequency = 10 GHz",
        "amplitude = (1 mT, 0 T, 0 T)",
        "A further force is dipoles",
        "cutoff = 10 µm",
    ):
        assert part in text


@pytest.mark.parametrize(("section", "body"), [("compression", "aggregate"), ("impact", "target")])
def test_the_material_of_a_file(section, body, tmp_path, capsys):
    """A body of a file that names its material is described with it, not with the default of the case."""
    path = tmp_path / "body.xyz"
    write_body(str(path), sand.Grains([[0.0, 0.0, 0.0], [2e-7, 0.0, 0.0]], "0.1 um", "iron"))
    other = '[projectile]\nkind = "grain"\nradius = "0.1 um"\nmaterial = "iron"\n' if body == "target" else ""
    how = 'rate = "1e-3 /t_c"\nto = 0.2' if section == "compression" else 'speed = "1 m/s"\nseeds = [1]'
    case = f'[{body}]\nkind = "file"\nfile = "{path.as_posix()}"\n{other}[{section}]\n{how}\n{CONTACT}'
    name = "laboratory.json" if section == "compression" else "collision.json"
    results = {name: {"runs": [{}], "collisions": [{}], "sand": "0.0.7"}}
    assert main(["methods", str(folder_of(tmp_path / "x", case, results))]) == 0
    text = capsys.readouterr().out
    assert "The material iron has" in text and "silica" not in text
    assert f"file = {path.as_posix()}, with the materials of that file" in text
