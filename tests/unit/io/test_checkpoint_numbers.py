"""Complete checkpoint archives with changed numbers or with embedded code are refused."""

import copy
import tracemalloc
import zipfile
from pathlib import Path

import numpy as np
import pytest

import sand
from sand.basics.state import STEPS
from sand.io.checkpoint import VERSION, newest_checkpoint, read_checkpoint, write_checkpoint

REFERENCE = Path(__file__).parents[2] / "reference" / f"run-v{VERSION}"


def written(folder, steps):
    """Write the reference state as that of this step; returns the path."""
    arrays, meta = read_checkpoint(next(REFERENCE.glob("*.npz")))
    meta = {name: value for name, value in meta.items() if name not in ("format", "version", "sha256")}
    arrays["count"][STEPS] = steps
    return write_checkpoint(folder, arrays, {**meta, "steps": steps})


def rewritten(path, change):
    """The archive repacked with `change` applied to its arrays, with valid zip checksums."""
    with np.load(path, allow_pickle=False) as saved:
        arrays = {name: saved[name] for name in saved.files}
    change(arrays)
    np.savez(path, **arrays)
    with zipfile.ZipFile(path) as archive:
        assert archive.testzip() is None


def set_number(arrays):
    position = arrays["grains/position"]
    position[1, 2] = np.nextafter(position[1, 2], 1.0)


def swap(arrays):
    arrays["grains/velocity"] = arrays["grains/velocity"][::-1].copy()


def drop(arrays):
    del arrays["count"]


def retype(arrays):
    arrays["count"] = arrays["count"].astype(np.float64)


@pytest.mark.parametrize("change", [set_number, swap, drop, retype])
def test_numbers_that_were_changed_are_refused(tmp_path, change):
    """A flipped bit, reordered rows, a missing array or another type: SAND's checksum is wrong."""
    written(tmp_path, 1)
    path = written(tmp_path, 2)
    rewritten(path, lambda arrays: None)
    assert read_checkpoint(path)[1]["steps"] == 2
    rewritten(path, change)
    with pytest.raises(sand.BadInput, match=path.name):
        read_checkpoint(path)
    with pytest.warns(UserWarning, match="is damaged"):
        assert newest_checkpoint(tmp_path)[1]["steps"] == 1


class Code:
    """An object whose unpickling would run code."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return open, (self.path, "w")


def test_code_in_a_checkpoint_is_not_run(tmp_path):
    """An array of objects is a pickle: refused in one line and not executed."""
    path = written(tmp_path, 1)
    trace = tmp_path / "run"

    def add(arrays):
        arrays["extra"] = np.array([Code(str(trace))], dtype=object)

    rewritten(path, add)
    trace.unlink(missing_ok=True)
    with pytest.raises(sand.BadInput, match=path.name) as caught:
        read_checkpoint(path)
    assert len(caught.value.problems) == 1
    assert not trace.exists()


def compress(path):
    """64 MiB of zeros, compressed."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive, archive.open("a.npy", "w") as member:
        for _ in range(64):
            member.write(bytes(2**20))


def share_bytes(path):
    """64 members of 1 MiB that are the same bytes of the file."""
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("a.npy", bytes(2**20))
        for k in range(63):
            again = copy.copy(archive.filelist[0])
            again.filename = f"{k}.npy"
            archive.filelist.append(again)


@pytest.mark.parametrize("change", [compress, share_bytes])
def test_a_small_file_that_unpacks_to_a_large_one_is_refused(tmp_path, change):
    """Members larger than the file are not from SAND, which does not compress; nothing of them is unpacked."""
    path = written(tmp_path, 1)
    change(path)
    with zipfile.ZipFile(path) as archive:
        assert sum(one.file_size for one in archive.infolist()) == 2**26 > 10 * path.stat().st_size
    tracemalloc.start()
    with pytest.raises(sand.BadInput, match="is not a readable checkpoint"):
        read_checkpoint(path)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 2**23
