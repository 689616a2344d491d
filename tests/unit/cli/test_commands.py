"""Which command a case file is for, and that `sand info` refuses what that command refuses."""

import pytest

import sand
from sand.cli.main import main
from sand.config.commands import command_for
from sand.io.bodies import write_body

RUN = """
[run]
until = "20 ns"
[box]
periodic = "400 nm"
[grains]
number = 8
radius = "10 nm"
"""
COLLIDE = """
[target]
kind = "chain"
grains = 3
radius = "0.1 um"
[projectile]
kind = "grain"
radius = "0.1 um"
[impact]
speed = "2 m/s"
seeds = [1, 2]
"""
SCATTER = """
[projectile]
radius = "10 nm"
material = "iron"
moment = "200 A m^2/kg"
[flight]
temperature = "100 K"
speed = "1 m/s"
"""
GROW = RUN + "[grow]\nseeds = [1, 2]\n"
SHEAR = """
[aggregate]
kind = "chain"
grains = 3
radius = "0.1 um"
[shear]
rate = "1 mm/s"
to = 0.5
by = "walls"
"""
CASES = {"run": RUN, "collide": COLLIDE, "scatter": SCATTER, "grow": GROW, "shear": SHEAR}


@pytest.mark.parametrize("meant", list(CASES))
@pytest.mark.parametrize("given", list(CASES))
def test_a_case_of_another_command(tmp_path, monkeypatch, capsys, meant, given):
    """One line names the right command and nothing is written; `sand grow` takes cases of `sand run`."""
    if given == meant or (given, meant) == ("grow", "run"):
        return
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.toml").write_text(CASES[meant])
    assert main([given, "a.toml"]) == 2
    assert capsys.readouterr().err == f"sand: a.toml: this is a case for `sand {meant}`; use: sand {meant} a.toml\n"
    assert len(list(tmp_path.iterdir())) == 1


def test_command_of_a_case():
    """By its tables; a body alone means a collision; an empty case has no command."""
    assert command_for({"target": {}, "impcat": {}}) == "collide"
    assert command_for({"projectile": {}, "flight": {}}) == "scatter"
    assert command_for({"forces": {}, "stepping": {}}) is None


@pytest.mark.parametrize("name", list(CASES))
def test_info_names_the_command_of_a_case(tmp_path, capsys, name):
    """`sand info` of each kind of case names its command."""
    (tmp_path / "a.toml").write_text(CASES[name])
    assert main(["info", str(tmp_path / "a.toml")]) == 0
    assert (f"sand {name} " in capsys.readouterr().out) is (name != "run")


@pytest.mark.parametrize("given", ['"0"', "0", '"0 nm"', '"0.5 b"', '"10 nm"', '"0b"', '"0.5 c"'])
def test_impact_parameters(tmp_path, capsys, given):
    """A length, or a fraction of the sum of radii; 0 needs no unit."""
    (tmp_path / "a.toml").write_text(COLLIDE.replace('"2 m/s"', f'"2 m/s"\nimpact_parameter = {given}'))
    assert main(["info", str(tmp_path / "a.toml")]) == 0


@pytest.mark.parametrize("command", ["collide", "scatter"])
def test_a_body_file_is_not_overwritten(tmp_path, monkeypatch, capsys, command):
    """A job whose output would overwrite the file of one of its bodies is refused, and the file stays."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "runs").mkdir()
    source = tmp_path / "runs" / "trajectory.gsd"
    write_body(tmp_path / "one.gsd", sand.setup.grain(radius="10 nm", material="iron", moment="200 A m^2/kg"))
    (tmp_path / "one.gsd").rename(source)
    body = '[target]\nkind = "file"\nfile = "runs/trajectory.gsd"\n'
    other = COLLIDE[COLLIDE.index("[projectile]") :] if command == "collide" else SCATTER
    (tmp_path / "a.toml").write_text(body + other)
    before = source.read_bytes()
    assert main([command, "a.toml", "--out", "runs", "--overwrite"]) == 2
    message = capsys.readouterr().err
    assert "--overwrite would replace " in message and "the target of a.toml" in message
    assert source.read_bytes() == before


@pytest.mark.parametrize("command", ["collide", "scatter"])
def test_files_of_bodies_are_relative_to_the_case_file(tmp_path, monkeypatch, capsys, command):
    """A body's `file` is found beside the case file from any folder; the earlier name `path` is refused with a hint."""
    (tmp_path / "cases").mkdir()
    write_body(tmp_path / "cases" / "one.gsd", sand.setup.grain(radius="10 nm", material="iron", moment="200 A m^2/kg"))
    other = COLLIDE[COLLIDE.index("[projectile]") :] if command == "collide" else SCATTER
    (tmp_path / "cases" / "a.toml").write_text('[target]\nkind = "file"\nfile = "one.gsd"\n' + other)
    (tmp_path / "cases" / "old.toml").write_text('[target]\nkind = "file"\npath = "one.gsd"\n' + other)
    monkeypatch.chdir(tmp_path)
    assert main(["info", "cases/a.toml"]) == 0
    assert main(["info", "cases/old.toml"]) == 2
    assert "target.path: there is no such key; it is now called 'file'" in capsys.readouterr().err
