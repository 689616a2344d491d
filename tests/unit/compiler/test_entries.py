"""Files of compiled code: whatever happens to them, a run starts, with one warning; copies of SAND share them."""

import errno
import os
import re
import shutil
import stat
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path

import pytest

import sand
from sand.compiler import cache
from sand.compiler.entries import Entries
from sand.compiler.jit import COMPILED

NAME, KEY, CONTENT = "drift-0123.nbc", "drift of JKR", b"machine code" * 100
needs_modes = pytest.mark.skipif(not hasattr(os, "getuid"), reason="no owners and modes on this system")


@pytest.fixture
def entries(tmp_path):
    """A folder with one file."""
    made = Entries(tmp_path / "cache" / "digest")
    made.write(NAME, KEY, CONTENT)
    return made


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    """A cache of the test's own."""
    monkeypatch.setenv("SAND_CACHE", str(tmp_path / "cache"))


def warnings_of(action):
    """What an action returns, and the warnings that it issues."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        return action(), [str(one.message) for one in caught]


def as_folder(path):
    path.unlink()
    path.mkdir()


def as_pipe(path):
    path.unlink()
    os.mkfifo(path)


DAMAGES = {
    "empty": lambda path: os.truncate(path, 0),
    "cut within the check sum": lambda path: os.truncate(path, 20),
    "cut": lambda path: os.truncate(path, path.stat().st_size - 1),
    "longer": lambda path: path.write_bytes(path.read_bytes() + b"\0"),
    "one bit": lambda path: path.write_bytes(path.read_bytes()[:-1] + bytes([path.read_bytes()[-1] ^ 1])),
    "of another program": lambda path: path.write_bytes(b"\x80\x04\x95" * 99),
    "a folder": as_folder,
    "a pipe": as_pipe,
}


@pytest.mark.parametrize("how", DAMAGES)
def test_damaged_files_are_not_used(entries, how):
    """One warning, which names the file; the next writing replaces it."""
    if how == "a pipe" and not hasattr(os, "mkfifo"):
        pytest.skip("no pipes with names on this system")
    path = entries.own / NAME
    assert entries.read(NAME, KEY) == CONTENT
    DAMAGES[how](path)
    found, told = warnings_of(lambda: [entries.read(NAME, KEY) for _ in range(3)])
    assert found == [None] * 3
    (line,) = told
    assert line.startswith("compiled code in the cache is compiled anew, because ") and str(path) in line
    if how != "a folder":
        entries.write(NAME, KEY, CONTENT)
        assert Entries(entries.own).read(NAME, KEY) == CONTENT


def test_a_file_of_another_function_is_not_used(entries):
    """The check sum is that of key and content: the file of another function under this name is not loaded."""
    entries.write("other.nbc", "drift of DMT", b"other code")
    os.replace(entries.own / "other.nbc", entries.own / NAME)
    found, told = warnings_of(lambda: entries.read(NAME, KEY))
    assert found is None and len(told) == 1 and "check sum" in told[0]


@needs_modes
def test_a_file_that_others_can_write_is_not_used(entries):
    """Whoever can write it can run code as its reader."""
    (entries.own / NAME).chmod(0o666)
    found, told = warnings_of(lambda: entries.read(NAME, KEY))
    assert found is None and len(told) == 1 and "other users can write it" in told[0]


@pytest.mark.parametrize("call", ["os.lstat", "pathlib.Path.read_bytes"])
def test_a_file_that_cannot_be_read_is_compiled_anew(entries, monkeypatch, call):
    """EIO, EACCES, EMFILE: a warning with the reason; the file stays."""
    for number in (errno.EIO, errno.EACCES, errno.EMFILE):

        def fail(*_, number=number):
            raise OSError(number, os.strerror(number))

        with monkeypatch.context() as changed:
            changed.setattr(call, fail)
            found, told = warnings_of(lambda: Entries(entries.own).read(NAME, KEY))
        assert found is None and len(told) == 1 and os.strerror(number) in told[0]
        assert entries.read(NAME, KEY) == CONTENT


@pytest.mark.parametrize("call", ["tempfile.mkstemp", "builtins.open", "os.chmod", "os.replace", "pathlib.Path.mkdir"])
def test_a_full_disk_keeps_nothing_from_starting(tmp_path, monkeypatch, call):
    """ENOSPC at any moment of writing: one warning, and no part of a file stays."""
    entries = Entries(tmp_path / "cache" / "digest")
    if call != "pathlib.Path.mkdir":
        entries.write("another.nbc", KEY, CONTENT)

    def fail(*_, **__):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as changed:
        changed.setattr(call, fail)
        _, told = warnings_of(lambda: [entries.write(name, KEY, CONTENT) for name in ("one.nbc", "two.nbc")])
    assert len(told) == 1 and "cannot be kept" in told[0] and os.strerror(errno.ENOSPC) in told[0]
    left = [path.name for path in (tmp_path / "cache").rglob("*") if path.is_file()]
    assert left == ([] if call == "pathlib.Path.mkdir" else ["another.nbc"])
    assert entries.read("one.nbc", KEY) is None


@pytest.mark.skipif(sys.platform != "linux", reason="limits of the size of files")
def test_a_file_that_cannot_be_completed_leaves_nothing(tmp_path):
    """The largest size of a file ends writing within the content, as a quota does."""
    code = (
        "import resource, warnings; from pathlib import Path; from sand.compiler.entries import Entries\n"
        f"entries = Entries(Path({str(tmp_path / 'cache' / 'digest')!r}))\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))\n"
        "entries.write('one.nbc', 'key', bytes(100_000))\n"
        "print(*entries.own.iterdir())"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0 and done.stdout == "\n"
    assert len(re.findall("cannot be kept", done.stderr)) == 1


def test_a_folder_that_was_deleted_is_made_again(entries):
    """Old folders of the cache can be deleted at any time."""
    shutil.rmtree(entries.own.parent)
    entries.write(NAME, KEY, CONTENT)
    assert entries.read(NAME, KEY) == CONTENT
    assert cache.unsafe(entries.own) is None


# ---- a cache that is only read -----------------------------------------------------------------------
@pytest.fixture
def read_only(entries, tmp_path, monkeypatch):
    """The filled cache without permission to write, whoever asks, and another default cache."""
    here, access = str(tmp_path / "cache"), os.access
    monkeypatch.setattr(
        os, "access", lambda path, mode: not (str(path).startswith(here) and mode & os.W_OK) and access(path, mode)
    )
    monkeypatch.setattr(cache, "_default", lambda: tmp_path / "home" / "sand")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return entries.own


def test_a_read_only_cache_is_read(read_only, tmp_path):
    """Its files are used without a word; new ones are written to the user's own cache."""
    found, told = warnings_of(lambda: cache.cache_folders("digest"))
    assert found == (tmp_path / "home" / "sand" / "digest", read_only) and not told
    both = Entries(*found)
    assert both.read(NAME, KEY) == CONTENT
    both.write("more.nbc", KEY, b"more")
    assert both.read("more.nbc", KEY) == b"more" and not (read_only / "more.nbc").exists()
    (_, read), told = warnings_of(lambda: cache.cache_folders("other"))
    assert read is None and len(told) == 1  # it has nothing of another version


def test_a_damaged_file_of_a_read_only_cache_is_replaced_in_the_own_one(read_only):
    """One warning at the first start, none at later ones."""
    os.truncate(read_only / NAME, 5)
    both = Entries(*cache.cache_folders("digest"))
    found, told = warnings_of(lambda: both.read(NAME, KEY))
    assert found is None and len(told) == 1
    both.write(NAME, KEY, CONTENT)
    assert warnings_of(lambda: Entries(*cache.cache_folders("digest")).read(NAME, KEY)) == (CONTENT, [])


@needs_modes
def test_the_cache_of_another_user_is_read_where_nobody_else_can_replace_it(entries, tmp_path, monkeypatch):
    """All folders above must belong to root, the reader or the owner, and be closed to others.

    In a folder where everybody may make files, as among temporary ones, anybody could have made it.
    """
    owner = os.getuid()
    monkeypatch.setattr(cache, "_default", lambda: tmp_path / "home")
    lstat, sticky = os.lstat, stat.S_ISVTX | 0o777
    modes, owners = {}, {}

    def status(path):
        found = list(lstat(path))
        found[0] = found[0] & ~0o7777 | modes.get(Path(path), 0o755)
        found[4] = owners.get(Path(path), 0)
        return os.stat_result(found)

    (tmp_path / "home").mkdir()
    owners |= {tmp_path / "cache": owner + 1, entries.own: owner + 1, tmp_path / "home": owner}
    owners[tmp_path / "home" / "digest"] = owner
    monkeypatch.setattr(os, "lstat", status)
    assert warnings_of(lambda: cache.cache_folders("digest")) == ((tmp_path / "home" / "digest", entries.own), [])
    above = tmp_path.parent
    modes[above] = sticky  # what lies in it belongs to root
    assert cache.cache_folders("digest")[1] == entries.own
    for change in ({above: sticky}, {tmp_path: sticky}, {tmp_path: 0o775}):
        modes.clear()
        modes.update(change)
        owners[tmp_path] = owner + 2 if above in change else 0
        assert cache.unsafe(entries.own, read_only=True).endswith("can put a folder in its place"), change
    modes.clear()
    owners[tmp_path] = owner + 2
    assert "lies below" in cache.unsafe(entries.own, read_only=True)


@needs_modes
def test_others_may_read_new_code_in_a_folder_that_they_may_read(tmp_path, monkeypatch):
    """A shared cache is made with `mkdir -m 755`; others read what its owner compiles, and write nothing."""
    (tmp_path / "cache").mkdir()
    for mode in (0o755, 0o750, 0o700):
        (tmp_path / "cache").chmod(mode)
        entries = Entries(cache.private_folder(f"{mode:o}"))
        entries.write(NAME, KEY, CONTENT)
        assert stat.S_IMODE(entries.own.stat().st_mode) == mode
        assert stat.S_IMODE((entries.own / NAME).stat().st_mode) == mode & 0o644


# ---- copies of SAND ------------------------------------------------------------------------------------
CASE = """
run.until = "1 ns"
box.periodic = "3 um"
grains = { number = 3, radius = "0.1 um", material = "silica", temperature = "300 K" }
"""


@pytest.mark.validate
@pytest.mark.skipif(not COMPILED, reason="the compiler is off")
def test_a_copy_of_the_sources_uses_the_same_code(tmp_path):
    """Installed in another folder, or edited and restored, SAND loads what it compiled before: as many files as before.

    So does a run after all files of the cache were damaged, with one note, once it has compiled anew.
    """
    case = tmp_path / "case.toml"
    case.write_text(CASE)
    package = Path(sand.__file__).parent
    shutil.copytree(package, tmp_path / "copy" / "sand", ignore=shutil.ignore_patterns("__pycache__"))

    def run(sources):
        words = [sys.executable, "-m", "sand.cli.main", "run", str(case), "--out", str(tmp_path / "o"), "--overwrite"]
        env = os.environ | {"PYTHONPATH": str(sources)}
        done = subprocess.run([*words, "--json"], env=env, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stderr

    assert "compiling" in run(package.parent)
    files = {path: path.stat().st_mtime_ns for path in (tmp_path / "cache").rglob("*.nbc")}
    assert len(files) > 2
    assert "compiling" not in run(tmp_path / "copy")
    assert files == {path: path.stat().st_mtime_ns for path in (tmp_path / "cache").rglob("*.nbc")}
    for path in files:
        os.truncate(path, path.stat().st_size // 2)
    assert run(package.parent).count("is compiled anew") == 1
    assert "compiled anew" not in run(package.parent)
