"""Plant single-line faults in a copy of a source tree, one at a time, and report which test catches each of them.

    python -m tests.faults.plant                                 # this checkout
    python -m tests.faults.plant --only "forgotten image" --jobs 2 --out table.md

For each fault of tests/faults/faults.py the tests that should catch it run first and stop at the first failure.  The
whole default suite runs only where they pass.  The tree itself is never changed: the script works on a copy in a
temporary folder, with a compiler cache of its own, and removes both at the end.  Before any fault is planted the
named tests run on the unchanged copy, where they must pass.
"""

from __future__ import annotations

import argparse
import contextlib
import datetime
import json
import os
import queue
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

from .faults import FAULTS, SOURCES, Fault

HERE = Path(__file__).parents[2]
BUILT = Path(SOURCES) / "viewer" / "page"
"""Files of a build that are not in git but that tests need."""
MISSED, TIMEOUT, CRASH = "MISSED", "TIMEOUT", "CRASH"
SUITE = "the whole suite"
REST = ["--ignore=tests/faults"]
"""All tests except those of the fault table itself, which would catch every fault."""
PASSED, FAILED, INTERRUPTED = 0, 1, 2
"""Exit codes of pytest; a test file that cannot be imported counts as interrupted."""


@dataclass(frozen=True)
class Finding:
    """The outcome of one fault."""

    fault: Fault
    caught_by: str  # test id, CRASH, TIMEOUT or MISSED
    ran: str  # the named test, or the whole suite
    seconds: float

    @property
    def caught(self) -> bool:
        return self.caught_by not in (MISSED, TIMEOUT)


def copy_of(tree: Path, place: Path) -> Path:
    """Copy the files that git tracks or would track, and the built page, with their times; returns the folder."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=tree,
        capture_output=True,
        check=True,
    )
    names = [Path(os.fsdecode(name)) for name in listed.stdout.split(b"\0") if name]
    names += [path.relative_to(tree) for path in (tree / BUILT).rglob("*") if path.is_file()]
    for name in dict.fromkeys(names):
        if (tree / name).is_file():
            (place / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(tree / name, place / name)
    return place


def environment(copy: Path) -> dict[str, str]:
    """Environment variables of a test run on a copy: its own source first, its own compiler cache, fixed hash seed.

    The cache is beside the copy.  Its key is a digest of the compiled sources: a fault in these is compiled, and all
    others share the compiled code.
    """
    kept = {key: value for key, value in os.environ.items() if not key.startswith(("PYTEST", "SAND_", "NUMBA_"))}
    cache = copy.parent / f"cache-{copy.name}"
    cache.mkdir(mode=0o700, exist_ok=True)
    own = {"PYTHONPATH": str(copy / "src"), "SAND_CACHE": str(cache), "PYTHONHASHSEED": "0", "MPLBACKEND": "Agg"}
    return kept | own | {"PYTHONDONTWRITEBYTECODE": "1"}


def run(copy: Path, words: Sequence[str], timeout: float) -> tuple[int | None, str]:
    """Run Python in a copy; exit code (None: no end within `timeout` seconds) and output.  Leaves no process behind."""
    process = subprocess.Popen(
        [sys.executable, *words],
        cwd=copy,
        env=environment(copy),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        start_new_session=True,
    )
    _RUNNING.add(process)
    try:
        output, _ = process.communicate(timeout=timeout)
        return process.returncode, output
    except subprocess.TimeoutExpired:
        return None, ""
    finally:
        end(process)
        _RUNNING.discard(process)


_RUNNING: set[subprocess.Popen[str]] = set()


def end(process: subprocess.Popen[str]) -> None:
    """Kill a process and what it has started."""
    with contextlib.suppress(OSError, AttributeError):  # the group has ended, or the system has no groups
        os.killpg(process.pid, signal.SIGKILL)
    process.kill()
    process.wait()


def pytest_words(tests: Sequence[str], workers: int = 0) -> list[str]:
    """Command-line words that run these tests, or all default ones, up to the first failure."""
    fixed = ["-p", "no:cacheprovider", "--hypothesis-seed=0", "--tb=line", "-rfE", "-n", str(workers)]
    return ["-m", "pytest", "-x", "-q", *fixed, *tests]


def verdict(code: int | None, output: str) -> str | None:
    """The test that failed, CRASH or TIMEOUT; None if all passed.  Raises SystemExit if no test could be run."""
    if code == PASSED:
        return None
    if code is None:
        return TIMEOUT
    if code < 0:
        return CRASH
    found = re.search(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", output, re.MULTILINE)
    if code in (FAILED, INTERRUPTED) and found:
        return found[1]
    raise SystemExit(f"pytest ended with exit code {code}:\n{output[-3000:]}")


@contextlib.contextmanager
def planted(copy: Path, fault: Fault) -> Iterator[None]:
    """The fault is in the copy for as long as the block lasts; afterwards the file is as it was, its times included."""
    file, old, new = fault.file, fault.old, fault.new
    path = copy / SOURCES / file
    times = path.stat()
    text = path.read_text(encoding="utf-8")
    if text.count(old) != 1:
        raise SystemExit(f"{fault.name}: its text occurs {text.count(old)} times in {file}, not once")
    path.write_text(text.replace(old, new), encoding="utf-8")
    try:
        yield
    finally:
        path.write_text(text, encoding="utf-8")
        os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))


def examine(fault: Fault, copy: Path, options: argparse.Namespace) -> Finding:
    """Plant one fault and look for a test that fails."""
    begun = time.monotonic()
    with planted(copy, fault):
        ran = fault.named
        found = verdict(*run(copy, pytest_words([ran]), options.timeout))
        if found is None and not options.named_only:
            ran, found = SUITE, verdict(*run(copy, pytest_words(REST, options.workers), options.suite_timeout))
    return Finding(fault, found or MISSED, ran, time.monotonic() - begun)


def prepare(tree: Path, place: Path, faults: Sequence[Fault], options: argparse.Namespace) -> list[Path]:
    """As many copies as jobs, in which the named tests have been seen to pass.  Raises SystemExit if they do not."""
    copies = []
    for number in range(options.jobs):
        copies.append(copy_of(tree, place / f"tree-{number}"))
        subprocess.run([sys.executable, "-m", "compileall", "-q", "src", "tests"], cwd=copies[-1], check=False)
    code, output = run(copies[0], ["-c", "import sand; print(sand.__file__)"], 300.0)
    if code != 0 or not Path(output.strip().splitlines()[-1]).is_relative_to(copies[0]):
        raise SystemExit(f"the copy of {tree} is not what Python imports:\n{output}")
    tests = sorted({fault.named for fault in faults})
    begun = time.monotonic()
    found = verdict(*run(copies[0], pytest_words(tests), options.timeout * max(len(faults), 1)))
    if found is not None:
        raise SystemExit(f"without any fault a named test does not pass: {found}")
    report(f"without a fault all named tests pass ({time.monotonic() - begun:.0f} s)")
    return copies


def report(line: str) -> None:
    """Print a line on standard error and flush."""
    print(line, file=sys.stderr, flush=True)


def examine_all(tree: Path, faults: Sequence[Fault], options: argparse.Namespace) -> list[Finding]:
    """All findings, in the order of the faults."""
    with tempfile.TemporaryDirectory(prefix="planted-", ignore_cleanup_errors=True) as place:
        copies: queue.SimpleQueue[Path] = queue.SimpleQueue()
        for copy in prepare(tree, Path(place).resolve(), faults, options):
            copies.put(copy)

        def one(fault: Fault) -> Finding:
            copy = copies.get()
            try:
                found = examine(fault, copy, options)
            finally:
                copies.put(copy)
            report(f"{found.seconds:5.0f} s  {fault.name}: {found.caught_by}")
            return found

        with ThreadPoolExecutor(options.jobs) as pool:
            try:
                return list(pool.map(one, faults))
            except BaseException:  # Ctrl-C, too
                pool.shutdown(wait=False, cancel_futures=True)
                for process in list(_RUNNING):
                    end(process)
                raise


def state_of(tree: Path) -> str:
    """The commit of a tree, and whether tracked files differ from it."""

    def git(*words: str) -> str:
        return subprocess.run(["git", *words], cwd=tree, capture_output=True, text=True).stdout.strip()

    return git("rev-parse", "--short=10", "HEAD") + (" with changes" if git("status", "--porcelain", "-uno") else "")


def caught_by_text(found: Finding) -> str:
    """The failed test, or the outcome and what was run."""
    return f"`{found.caught_by}`" if found.caught else f"{found.caught_by} by {found.ran}"


def as_markdown(findings: Sequence[Finding], state: str, total: float) -> str:
    """The table as Markdown."""
    caught = sum(found.caught for found in findings)
    rows = [
        f"| {found.fault.name} | {found.fault.kind} | {found.fault.area} | `{SOURCES}{found.fault.file}` "
        f"| {caught_by_text(found)} | {found.seconds:.0f} |"
        for found in findings
    ]
    head = (
        f"Planted faults at {state}, {datetime.date.today()}: {caught} of {len(findings)} caught, "
        f"{total / 60:.0f} minutes (made by `python -m tests.faults.plant`)."
    )
    columns = ["| fault | kind | part | file | caught by | s |", "|---|---|---|---|---|---|"]
    return "\n".join([head, "", *columns, *rows]) + "\n"


def as_json(findings: Sequence[Finding], state: str, total: float) -> str:
    """The table as JSON."""
    rows = [asdict(found) | {"caught": found.caught} for found in findings]
    content = {"commit": state, "date": str(datetime.date.today()), "seconds": round(total), "faults": rows}
    return json.dumps(content, indent=1, ensure_ascii=False) + "\n"


def chosen(words: Sequence[str]) -> list[Fault]:
    """The faults with one of these words in their name, kind, part or file; all without any word."""
    if not words:
        return list(FAULTS)
    return [fault for fault in FAULTS if any(word in fault.searched for word in words)]


def parsed(argv: Sequence[str] | None) -> argparse.Namespace:
    """The options of the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tree", type=Path, default=HERE, help="checkout to copy (default: this one)")
    parser.add_argument("--only", nargs="+", default=[], metavar="WORD", help="faults with one of these words")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="copies that work at the same time")
    parser.add_argument("--timeout", type=float, default=300.0, metavar="S", help="for the named tests of one fault")
    parser.add_argument("--suite-timeout", type=float, default=3600.0, metavar="S", help="for the whole suite")
    parser.add_argument("--workers", type=int, default=2, metavar="N", help="processes of the whole suite")
    parser.add_argument("--named-only", action="store_true", help="never run the whole suite")
    parser.add_argument("--out", type=Path, metavar="FILE", help="write the table there, .json or Markdown")
    parser.add_argument("--list", action="store_true", help="print the faults and end")
    return parser.parse_args(argv)


def main(argv: Sequence[str] | None = None) -> int:
    """Print the table; the exit code is 1 if a fault was not caught."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # so that the copies are removed then, too
    options = parsed(argv)
    faults, tree = chosen(options.only), options.tree.resolve()
    if options.list or not faults:
        print("\n".join(fault.searched for fault in faults) or "no fault has such a word")
        return 0
    begun = time.monotonic()
    findings = examine_all(tree, faults, options)
    total = time.monotonic() - begun
    table = as_markdown(findings, state_of(tree), total)
    print(table, end="")
    if options.out is not None:
        text = as_json(findings, state_of(tree), total) if options.out.suffix == ".json" else table
        options.out.write_text(text, encoding="utf-8")
    return 0 if all(found.caught for found in findings) else 1


if __name__ == "__main__":
    sys.exit(main())
