"""The page of a running simulation is updated."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from .driving import Driven, served
from .small_runs import GRAINS, MERGED, PARTED, SmallRun, at_rest


@pytest.fixture
def run(tmp_path, bundle) -> SmallRun:
    """Three frames of eight are written."""
    return SmallRun(tmp_path / "going", 3, ended=False)


@pytest.fixture
def view(page, run) -> Iterator[Driven]:
    page.set_viewport_size({"width": 800, "height": 560})
    with served(run.folder) as server:
        yield Driven(page, server.url, bare=True)


def until(view: Driven, words: str) -> None:
    """The line beside the name says so."""
    view.tab.locator(".gv-status", has_text=words).wait_for()
    view.settle()


def test_new_frames_are_shown(view, run):
    """At the last frame it follows; at another it stays; ticks and plot grow; the end is reported."""
    assert "3 frames · still running" in " ".join(view.text(".gv-status").split())
    view.press("End")
    run.append(2)
    until(view, "5 frames")
    assert view.get("frame") == 4 == view.run("app.picture.frame.frame")
    assert view.run("app.plot.chart.data[0].at(-1)") == pytest.approx(4.0, rel=1e-6, abs=0.0)
    assert [mark["frame"] for mark in view.run("app.timeline.events")] == [MERGED]
    line, over = (view.tab.locator(f".gv-plot {part}").bounding_box() for part in (".gv-cursor", ".u-over"))
    assert line["x"] == pytest.approx(over["x"] + view.run("app.plot.chart.valToPos(4, 'x')"), abs=1.5)
    view.press("ArrowLeft")
    run.append(2)
    until(view, "7 frames")
    assert view.get("frame") == 3 == view.run("app.picture.frame.frame")
    assert "frame 3 of 6" in view.text(".gv-time")
    assert view.run("app.timeline.slider.max") == "6"
    view.press("n", "n")
    assert view.get("frame") == PARTED
    view.control("live").click()
    run.append(1)
    run.end()
    until(view, "ended as wished")
    assert view.get("frame") == PARTED
    assert "8 frames" in view.text(".gv-status") and "still running" not in view.text(".gv-status")
    asked = []
    view.tab.on("request", lambda request: asked.append(request.url))
    view.tab.wait_for_timeout(1300)
    assert not asked


def test_awake_grains_of_a_running_simulation(page, tmp_path, bundle):
    """Each new frame has its colours, legend and number of awake grains; the plot of them grows."""
    run = SmallRun(tmp_path / "rigid", 3, ended=False, rigid=True)
    page.set_viewport_size({"width": 800, "height": 560})
    with served(run.folder) as server:
        view = Driven(page, f"{server.url}#frame=2&colour=at_rest&plot=awake", bare=True)
        for frames, awake in ((3, 0), (5, 8), (6, 8), (7, 0)):
            run.append(frames - run.count)
            until(view, f"{frames} frames")
            assert f"frame {frames - 1} of {frames - 1} · {awake} awake" in " ".join(view.text(".gv-time").split())
            assert view.text(".gv-legend").split("\n")[1:] == [
                f"{awake} awake (contact steps)",
                f"{GRAINS - awake} at rest (rigid)",
            ]
            colours = np.array(view.run("[...app.picture.painted.colour]")).reshape(-1, 4)
            assert len(np.unique(colours, axis=0)) == (2 if awake else 1)
        awake_at = [int((~at_rest(at)).sum()) for at in np.arange(0.0, 6.1, 0.5)]
        assert view.plotted()[0] == pytest.approx(awake_at, rel=1e-6, abs=1e-6)
        assert "grains of awake clusters" in view.text(".gv-plot")


def test_playing_goes_on_into_new_frames(view, run):
    """Frames that arrive during playing are played, too."""
    view.put(speed=2)
    view.press("Space")
    run.append(5)
    until(view, "8 frames")
    view.put(speed=60)
    view.tab.wait_for_selector("button[aria-label=Play]")
    assert view.get("frame") == 7


def test_a_run_that_is_followed_from_an_address(view, run):
    """A frame that is not there yet is the last one; nothing is lost."""
    view.open(view.tab.url.split("#")[0] + "#frame=7")
    assert view.run("app.picture.frame.frame") == 2 == view.get("frame")
    view.press("ArrowLeft")
    assert view.get("frame") == 1


def test_scales_and_plots_grow_with_the_run(tmp_path, page, bundle):
    """Opened at the first frame: ranges of losses and cluster sizes are updated later."""
    page.set_viewport_size({"width": 800, "height": 560})
    run = SmallRun(tmp_path / "young", 1, ended=False)
    with served(run.folder) as server:
        view = Driven(page, server.url)
        view.put(colour="size")
        assert "losses" not in dict(view.run("app.state.setting('plot').options"))
        run.append(MERGED)
        until(view, "5 frames")
        assert view.run("app.picture.painted.scale.high") == 8
        assert view.control("plot").locator("option[value=losses]").count() == 1
        view.control("plot").select_option("losses")
        assert view.get("plot") == "losses"


def test_a_restarted_run(view, run):
    """The page says so and stops requesting frames: it shows the earlier run."""
    (run.folder / "trajectory.gsd").unlink()
    SmallRun(run.folder, 2, ended=False)
    view.tab.locator(".gv-note", has_text="restarted").wait_for()
    assert view.run("app.picture.frame.frame") == 2
