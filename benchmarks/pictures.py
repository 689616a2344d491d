"""Pictures of README and docs: a still and the page, of the last frame of examples/iron-gas.toml; a film."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import sand
from sand.analysis.clusters import cluster_labels, unwrapped
from sand.analysis.shape import gyration_radius, gyration_tensor

from . import quoted, start_up
from .timing import ran

STATIC = quoted.TOP / "docs" / "_static"
STILL = STATIC / "iron-gas.png"
PAGE = STATIC / "grainview.png"
FILM = STATIC / "collision.gif"
FILMED = quoted.TOP / "examples" / "gallery" / "collisions" / "energy_of_a_collision.py"
"""Script of the run in the film, which has its files in the folder `impact`."""
HOW_FILMED = "--size 480x320 --fps 6 --frames :51:3 --settings theme=light&bonds=off --overwrite"
"""17 frames, until the pieces have parted: below 300 kB."""
WINDOW = {"width": 1200, "height": 720}
"""Of the browser, in pixels."""
KEYS = ("Z", *"[[[[[[")
"""The largest cluster broadside; smaller grains, so that contacts and arrows are seen."""


class Broadside(NamedTuple):
    """The most extended cluster of a frame, and how to look at it.

    Attributes:
        rank: by size, as `sand plot --cluster` counts; 1 is the largest.
        shortest: direction of its shortest axis, towards the eye.
    """

    rank: int
    shortest: np.ndarray


def broadside(frame: Any) -> Broadside:
    """The most extended cluster of a frame, whose longest axis shall lie across the picture."""
    labels = cluster_labels(len(frame.position), frame.pair)
    whole = unwrapped(frame.position, frame.pair, frame.box)
    ranked = np.argsort(-np.bincount(labels), kind="stable")
    members = [np.flatnonzero(labels == k) for k in ranked if np.sum(labels == k) > 1]
    widest = int(np.argmax([gyration_radius(whole[body]) for body in members]))
    shortest = np.linalg.eigh(gyration_tensor(whole[members[widest]]))[1][:, 0]
    return Broadside(widest + 1, shortest if shortest[2] > 0.0 else -shortest)


def draw(folder: Path, top: Path, environment: Mapping[str, str]) -> int:
    """Draw both pictures of a run; number of grains of the largest cluster, which that of the page shows.

    Args:
        folder: of the run.
        top: a folder for files on the way.
        environment: of the command that draws the still.
    """
    seen = broadside(sand.open(folder).frames[-1])
    view = ",".join(f"{x:.1f}" for x in seen.shortest)
    words = ["--what", "still", "--cluster", str(seen.rank), f"--view={view}", "--perspective", "--size", "1200x520"]
    ran([*start_up.SAND, "plot", str(folder), *words, "--out", str(top / "plots")], env=dict(environment))
    shutil.copyfile(top / "plots" / "still.png", STILL)
    return page(folder, PAGE)


def film(top: Path, environment: Mapping[str, str]) -> None:
    """A film of the collision of two aggregates, by the page; needs a Chromium.

    Args:
        top: a folder for files on the way.
        environment: of the commands.
    """
    ran([sys.executable, "-W", "ignore", str(FILMED)], cwd=top, env=dict(environment))
    words = ["--movie", str(FILM), "--renderer", "page", *HOW_FILMED.split()]
    ran([*start_up.SAND, "view", str(top / "impact"), *words], env=dict(environment))


def page(folder: Path, target: Path) -> int:
    """A picture of the page of `sand view` after the keys of README, KEYS; grains of the cluster; needs a Chromium."""
    from playwright.sync_api import sync_playwright
    from tests.browser.chromium import FLAGS, find
    from tests.browser.driving import Driven, served

    with sync_playwright() as playwright, served(folder, None) as server:
        browser = playwright.chromium.launch(executable_path=find(), headless=True, args=list(FLAGS))
        tab = Driven(browser.new_page(viewport=WINDOW), server.url, bare=True)
        tab.press(*KEYS)
        tab.tab.screenshot(path=target)
        grains = tab.run("app.selection.largestCluster().reduce((sum, one) => sum + one)")
        browser.close()
    return int(grains)
