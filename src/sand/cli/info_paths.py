"""What `sand info` says of a path: which description belongs to a folder, or to a file of which type."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from ..basics.errors import BadInput
from ..config.folders import job_in
from ..io import run_folder as files
from ..io.table import read_table
from . import report
from .info_jobs import JOBS, Description, describe_job, describe_results
from .info_run import describe_checkpoint, describe_ledger, describe_run, describe_summary, describe_trajectory


def describe(path: Path) -> Description:
    """Describe a folder or a file according to its type.  Raises BadInput."""
    if path.is_dir():
        return describe_folder(path)
    if not path.exists():
        raise BadInput(f"there is no file or folder {path}")
    if path.suffix not in FILE_TYPES:
        raise BadInput(
            f"{path} is not a file that SAND can describe; give a run's folder, a case file (.toml), trajectory.gsd, "
            "a checkpoint (.npz), summary.json, ledger.csv or another table (.csv)"
        )
    return FILE_TYPES[path.suffix](path)


def describe_folder(path: Path) -> Description:
    """Describe the folder of a run or a job: its outcome, or its present state."""
    if not any((path / name).exists() for name in (files.CASE, files.ONE_COLLISION)):
        raise BadInput(f"{path} is not the folder of a run: there is no {files.CASE} in it")
    listed = ("files", "  ".join(report.files_of(path)))
    for name in (files.SCATTERING, files.COLLISION, files.LABORATORY):
        if (path / name).exists() and (job := describe_results(path / name, files.read_json(path / name))):
            heading, rows, content = job
            return heading, [*rows, listed], {**content, "folder": str(path)}
    job_command, case, begun = job_in(path)
    if job_command in JOBS:
        return describe_job(path, job_command, case, begun, [listed])
    return describe_run(path, listed)


def _describe_case(path: Path) -> Description:
    """Check and describe a case file."""
    from .info_cases import describe_case  # which imports all that computes

    return describe_case(path)


def describe_json(path: Path) -> Description:
    """Describe the summary of a run, or the results of another command."""
    if (job := describe_results(path, files.read_json(path))) is not None:
        return job
    return describe_summary(path)


def describe_csv(path: Path) -> Description:
    """Describe a ledger, or any other table."""
    if path.name == files.LEDGER:
        return describe_ledger(path)
    names, *lines = read_table(path)
    if names[:1] == ["step"]:
        return describe_ledger(path)
    rows = [("rows", str(len(lines))), ("columns", ", ".join(names))]
    return TABLES.get(path.name, "a table"), rows, {"kind": "table", "rows": len(lines), "columns": names}


TABLES = {
    files.RESULTS_CSV: "the rows of all runs of a job",
    files.SWEEP_CSV: "the table of a sweep, a row for each run",
    files.ROWS_CSV: "the rows of the tables of all runs of a sweep",
    files.COMPARISON: "the comparison of sand reproduce with a paper",
}
"""What tables hold, by the name of their file."""
FILE_TYPES: dict[str, Callable[[Path], Description]] = {
    ".toml": _describe_case,
    ".gsd": describe_trajectory,
    ".npz": describe_checkpoint,
    ".json": describe_json,
    ".csv": describe_csv,
}
