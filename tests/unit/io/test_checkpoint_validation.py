"""Checkpoints with a valid checksum and impossible numbers are refused before compiled code reads them."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

import sand
from sand import components
from sand.basics.array_groups import Array, new_group, saved_in
from sand.basics.arrays import body_arrays
from sand.basics.state import CONTACTS, COUNT, GRAIN1, PAIRS, PHASE, STEPS
from sand.cli.main import main
from sand.io.checkpoint import VERSION, newest_checkpoint, read_checkpoint, write_checkpoint
from sand.io.state_arrays import ALWAYS, NUMBERS, OPTIONAL, PLANNED_END, SINGLE, check_state

REFERENCE = Path(__file__).parents[2] / "reference"
ARRAYS, META = read_checkpoint(next((REFERENCE / f"run-v{VERSION}").glob("*.npz")))
META = {name: value for name, value in META.items() if name not in ("format", "version", "sha256")}
GROUPS = {**ALWAYS, **OPTIONAL, **{name: group for each in components.groups() for name, group in each.items()}}
STORED: dict[str, Array] = SINGLE | {
    f"{name}/{key}": each for name, group in GROUPS.items() for key, each in saved_in(group).items()
}
"""All arrays of a checkpoint."""


def saved(name, arrays):
    """The arrays of a group that a checkpoint has."""
    return {f"{name}/{key}": getattr(arrays, key) for key in saved_in(arrays)}


SIZES = {"used": 1, "grains": 4, "walls": 1, "constants": 5, "channels": 4}
ONE_WALL = {k: v for name in ("walls", "wall_contacts") for k, v in saved(name, new_group(GROUPS[name], SIZES)).items()}
"""A wall with one contact."""
BODIES = saved("bodies", body_arrays(4))
BODIES["bodies/first"][:] = np.arange(4)
CROSSINGS = {"grains/image": np.zeros((3, 4), np.int32)}
KEPT = {"contacts/kept": np.zeros((7, ARRAYS["contacts/pair"].shape[1]))}
CELL = saved("cell", new_group(GROUPS["cell"], SIZES))
BUILT = {f"{name}/built": np.full(3, 1e-6) for name in ("pair_list", "long_range")}
WITH_ORDER = {
    **ARRAYS,
    **CELL,
    **BUILT,
    "order": np.arange(4, dtype=np.uint32),
    **ONE_WALL,
    **BODIES,
    **CROSSINGS,
    **KEPT,
}
FAR = 2**31 - 1
"""An index out of range."""


def error_of(folder, arrays, meta=META):
    """The error message for a checkpoint written with a valid checksum."""
    path = write_checkpoint(folder, arrays, dict(meta))
    with pytest.raises(sand.BadInput) as error:
        newest_checkpoint(folder, components.groups())
    message, last = error.value.problems
    assert message.startswith(f"{path} cannot be resumed: ") and "no checkpoint to continue from" in last
    assert path.exists()
    return message


def refusal_of(arrays):
    """The error message for these arrays, without a file."""
    with pytest.raises(sand.BadInput) as error:
        check_state(arrays, META | {"version": VERSION}, components.groups())
    (message,) = error.value.problems
    return message


def test_the_reference_state_is_valid():
    """The reference checkpoint has no errors."""
    check_state(*read_checkpoint(next((REFERENCE / f"run-v{VERSION}").glob("*.npz"))))


def test_every_array_of_a_checkpoint_is_declared():
    """A new array needs a declaration."""
    assert set(WITH_ORDER) == set(STORED)


def test_arrays_of_walls_keep_their_names():
    """Checkpoints of earlier versions have them."""
    walls = {name for name in STORED if name.startswith(("walls/", "wall_contacts/"))}
    own = ("position", "velocity", "normal", "force", "impulse", "work")
    vectors, others = ("pointer1", "pointer2", "force", "torque1"), ("twist", "formed", "constants", "lost", "damping")
    of_contacts = ("pair", *vectors, *others, "flag")
    walls.remove("walls/push")  # that is new, and not required
    assert walls == {*(f"walls/{name}" for name in own), *(f"wall_contacts/{name}" for name in of_contacts)}


def test_a_checkpoint_with_walls_of_an_earlier_version_is_valid():
    """Earlier versions counted the contacts with walls in `count`, too, and the entry has no meaning now."""
    count = ARRAYS["count"].copy()
    count[18] = 1
    check_state({**WITH_ORDER, "count": count}, META, components.groups())


def test_a_group_of_a_component_is_whole():
    """If any array of a component is there, all of its groups must be."""
    without = {name: array for name, array in WITH_ORDER.items() if not name.startswith("wall_contacts/")}
    assert refusal_of(without) == "there is no array 'wall_contacts/pair'"


@pytest.mark.slow
@pytest.mark.parametrize("name", list(STORED))
def test_wrong_types_shapes_and_values(tmp_path, name):
    """Each array: other type, one column less or more, one axis less, NaN, an index out of range."""
    good = WITH_ORDER[name]
    changed = {
        "type": good.astype({"f": np.float32, "u": np.int64, "i": np.float64}[good.dtype.kind]),
        "axis": good[None],
        "number": np.array(1, good.dtype),
    }
    if good.shape[-1] > 1 or name not in ("contacts/constants", "pair_list/step", "pair_list/break_overlap"):
        changed["shape"] = np.concatenate([good, good], axis=-1) if good.size else np.zeros((3, 1))
    if good.size and good.dtype.kind == "f":
        changed["not a number"] = np.full_like(good, np.nan)
    if (
        good.size
        and good.dtype.kind != "f"
        and name.split("/")[-1] in ("pair", "side", "start", "order", "id", "first")
    ):
        changed["beyond"] = good.copy()
        changed["beyond"].flat[-1] = FAR
    if name in ("grains/radius", "grains/mass", "grains/inertia"):
        changed["zero"], changed["below 0"] = 0.0 * good, -good
    if name in ("contacts/every_step", "pair_list/in_contact", "bodies/asleep"):
        changed["neither"] = np.full_like(good, 2)
    for what, array in changed.items():
        message = refusal_of({**WITH_ORDER, name: array})
        sizing = what == "shape" and name in (
            "grains/radius",
            "contacts/pair",
            "pair_list/pair",
            "walls/position",
            "wall_contacts/pair",
        )  # then other arrays are inconsistent
        assert sizing or f"'{name}'" in message, (what, message)
    if STORED[name].required:
        without = {other: array for other, array in WITH_ORDER.items() if other != name}
        assert re.search(f"there is no array '{name}'", refusal_of(without))
    message = error_of(tmp_path, {**WITH_ORDER, name: changed["axis"]})
    assert f"'{name}'" in message


def changed_entry(name, index, value):
    array = WITH_ORDER[name].copy()
    array[index] = value
    return {**WITH_ORDER, name: array}


@pytest.mark.parametrize(
    ("index", "value"),
    [(CONTACTS, 2), (CONTACTS, 10**15), (CONTACTS, -1), (PAIRS, 4), (PHASE, 1), (STEPS, 61), (GRAIN1, FAR)],
)
def test_inconsistent_counters(tmp_path, index, value):
    """Numbers of contacts and pairs against the arrays, the step against meta.json, an invalid grain index."""
    assert f"{COUNT[index]} = {value}" in error_of(tmp_path, changed_entry("count", index, value))


def test_inconsistent_lists(tmp_path):
    """A pair of one grain, a contact in the wrong row, decreasing row starts, a grain twice in the order."""
    for name, index, value, words in (
        ("contacts/pair", (0, 0), ARRAYS["contacts/pair"][1, 0], "the same grain twice"),
        ("pair_list/pair", (1, 0), ARRAYS["pair_list/pair"][0, 0], "the same grain twice"),
        ("contacts/start", 1, 5, "'contacts/start'"),
        ("order", 0, 1, "once"),
        ("grains/id", 0, 1, "each once"),
    ):
        assert words in error_of(tmp_path, changed_entry(name, index, value))
    turned = ARRAYS["contacts/side"][::-1].copy()
    assert "contacts of each grain" in error_of(tmp_path, {**ARRAYS, "contacts/side": turned})


@pytest.mark.parametrize("name", [*NUMBERS, *PLANNED_END, "choices", "case", "ledger"])
def test_invalid_metadata(name):
    """Text, a list, NaN, infinite, negative or missing: one line that names the entry."""
    strange = ["", 3] if name in ("choices", "case", "ledger") else ["", [1], -1, np.nan, np.inf, 10**400, True]
    for value in strange:
        with pytest.raises(sand.BadInput, match=f"meta.json has {name} = "):
            check_state(ARRAYS, {**META, "version": VERSION, name: value})
    if name in (*NUMBERS, *PLANNED_END):
        with pytest.raises(sand.BadInput, match=f"meta.json has {name} = None"):
            check_state(ARRAYS, {key: value for key, value in META.items() if key != name} | {"version": VERSION})


@pytest.mark.slow
def test_commands_refuse_invalid_checkpoints(tmp_path, capsys):
    """`sand resume` and `sand info`: exit code 2 and one line; also materials that the case lacks."""
    for arrays in (
        changed_entry("contacts/pair", (1, 2), FAR),
        changed_entry("pair_list/pair", (1, 2), FAR),
        changed_entry("grains/material", slice(None), 1),
    ):
        folder = tmp_path / "run"
        shutil.copytree(REFERENCE / f"run-v{VERSION}", folder)
        path = write_checkpoint(folder, arrays, dict(META))
        assert main(["resume", str(folder)]) == 2
        message = capsys.readouterr().err.strip().splitlines()
        assert str(folder) in message[0] and not [line for line in message if "internal" in line]
        if arrays["grains/material"][0] == 0:
            assert f"names grain {FAR}, but the grains are 0 to 3" in message[0]
            assert main(["info", str(path)]) == 2
        shutil.rmtree(folder)
