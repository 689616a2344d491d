"""The folder for compiled code must be writable by its user only: whoever can write it can run code."""

import os
import stat
import subprocess
import sys
import tempfile
import warnings

import pytest

from sand.compiler import cache

needs_modes = pytest.mark.skipif(not hasattr(os, "getuid"), reason="no owners and modes on this system")


@pytest.fixture
def home(tmp_path, monkeypatch):
    """A home and a temporary folder, and a usual umask."""
    monkeypatch.delenv("SAND_CACHE", raising=False)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    (tmp_path / "tmp").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "tmp"))
    before = os.umask(0o022)
    yield tmp_path
    os.umask(before)


def chosen(*expected):
    """The folder, which must exist and be safe, chosen with one warning that contains all these words."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        folder = cache.private_folder("digest")
    assert len(caught) == (1 if expected else 0), [str(w.message) for w in caught]
    for words in expected:
        assert words in str(caught[0].message) and "\n" not in str(caught[0].message)
    assert folder.name == "digest" and cache.unsafe(folder) is None
    return folder


def mode(folder):
    return stat.S_IMODE(os.lstat(folder).st_mode)


@pytest.mark.skipif(sys.platform != "linux", reason="the places of Linux")
def test_the_usual_folder(home, monkeypatch):
    """~/.cache/sand, $XDG_CACHE_HOME/sand, $SAND_CACHE: new folders are private."""
    usual = home / "home" / ".cache" / "sand"
    assert chosen() == usual / "digest"
    assert mode(usual) == mode(usual / "digest") == 0o700
    monkeypatch.setenv("XDG_CACHE_HOME", str(home / "xdg"))
    assert chosen() == home / "xdg" / "sand" / "digest"
    monkeypatch.setenv("SAND_CACHE", str(home / "mine"))
    assert chosen() == home / "mine" / "digest"
    assert mode(home / "mine") == mode(home / "mine" / "digest") == 0o700


@needs_modes
def test_a_folder_that_only_its_user_can_write_is_kept(home, monkeypatch):
    """Earlier versions used the usual umask: others may read, not write."""
    monkeypatch.setenv("SAND_CACHE", str(home / "mine"))
    (home / "mine").mkdir(mode=0o755)
    assert chosen() == home / "mine" / "digest"
    assert mode(home / "mine") == 0o755


@needs_modes
def test_a_folder_that_others_can_write_is_refused(home, monkeypatch):
    """Writable by group or others, itself or this version's subfolder; a private one is used instead."""
    monkeypatch.setenv("SAND_CACHE", str(home / "mine"))
    private = home / "tmp" / f"sand-cache-{os.getuid()}"
    for bits in (0o775, 0o757, 0o1777):
        (home / "mine").mkdir(exist_ok=True)
        (home / "mine").chmod(bits)
        assert chosen(f"{home / 'mine'} can be written", f"mode {bits:04o}", str(private)) == private / "digest"
        assert mode(private) == 0o700
        assert not (home / "mine" / "digest").exists()
    (home / "mine").chmod(0o700)
    (home / "mine" / "digest").mkdir()
    (home / "mine" / "digest").chmod(0o777)
    assert chosen("can be written") == private / "digest"


@needs_modes
def test_a_folder_of_another_user_is_refused(home, monkeypatch):
    """Also one of root."""
    monkeypatch.setenv("SAND_CACHE", str(home / "theirs"))
    (home / "theirs").mkdir(mode=0o700)
    owner, me = os.getuid(), os.getuid() + 1
    monkeypatch.setattr(os, "getuid", lambda: me)  # the folder belongs to another user
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        assert cache.unsafe(home / "theirs").startswith(f"belongs to another user (uid {owner}), ")
        with pytest.raises(cache._UnsafeFolder):  # here all folders belong to another user, the new one, too
            cache.private_folder("digest")
    assert "belongs to another user" in str(caught[0].message)
    assert not (home / "theirs" / "digest").exists()


@needs_modes
def test_a_link_is_refused(home, monkeypatch):
    """Its owner can change the target; a link to nothing is refused, too."""
    (home / "real").mkdir()
    for aim in ("real", "nowhere"):
        link = home / f"to-{aim}"
        link.symlink_to(home / aim)
        monkeypatch.setenv("SAND_CACHE", str(link))
        chosen("is a symbolic link")
    assert not list((home / "real").iterdir()) and not (home / "nowhere").exists()


@needs_modes
def test_a_fallback_folder_of_another_user_is_not_used(home, monkeypatch):
    """Anybody can create TMPDIR/sand-cache-UID first: then a new temporary one is used and deleted at exit."""
    (home / "home").write_text("no folder can be made in a file")
    planted = home / "tmp" / f"sand-cache-{os.getuid()}"
    planted.mkdir()
    planted.chmod(0o777)
    registered = []
    monkeypatch.setattr(cache.atexit, "register", lambda *given: registered.append(given))
    folder = chosen("is not cached", f"{planted} can be written by other users")
    assert folder.parent.parent == home / "tmp" and folder.parent != planted
    assert mode(folder.parent) == mode(folder) == 0o700
    ((delete, *given),) = registered
    delete(given[0], -1)  # as in a forked process, which must not delete it
    assert folder.exists()
    delete(*given)
    assert not folder.parent.exists()
    planted.chmod(0o755)
    assert chosen() == planted / "digest"  # a home folder without space causes no message


def test_a_folder_that_cannot_be_created_is_reported(home, monkeypatch):
    """$SAND_CACHE below a file, or a file itself."""
    (home / "file").write_text("")
    for wished in (home / "file" / "cache", home / "file"):
        monkeypatch.setenv("SAND_CACHE", str(wished))
        chosen(str(wished))


def test_systems_without_owners(home, monkeypatch):
    """Without `os.getuid`, as on Windows, no owner is checked and there is no shared fallback folder."""
    monkeypatch.delattr(os, "getuid", raising=False)
    monkeypatch.setenv("SAND_CACHE", str(home / "mine"))
    assert chosen() == home / "mine" / "digest"
    (home / "file").write_text("")
    monkeypatch.setenv("SAND_CACHE", str(home / "file"))
    assert chosen("is not cached").parent.name != "sand-cache"


IMPORT = "import sys, sand; assert 'platformdirs' not in sys.modules and 'numba' not in sys.modules"


def test_importing_sand_imports_no_folder_library():
    """`import sand` imports no library for standard folders."""
    subprocess.run([sys.executable, "-c", IMPORT], check=True)


def test_a_process_has_one_folder():
    """Repeated requests give the same folder, named by the digest; summaries give it as `source_digest`."""
    from sand.compiler import jit

    assert jit.cache_folder() is jit.cache_folder()
    assert len(jit.cache_folder().name) == 16
