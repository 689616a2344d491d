"""The page in a notebook: the bundle as a module, a model whose answers come from Python."""

from __future__ import annotations

import base64
from collections.abc import Iterator

import pytest

from sand.basics.errors import BadInput
from sand.viewer.dataset import RunDataset, run_dataset
from sand.viewer.notebook import answer_message

from .driving import Driven
from .small_runs import FIELD, FRAMES, SmallRun

NOTEBOOK = """async ([script, styles]) => {
  document.body.innerHTML = '<style></style><h1>notes</h1><div id="cell" style="width: 520px"></div>';
  document.querySelector("style").textContent = styles;
  const heard = new Map();
  window.heard = heard;
  window.pressed = [];
  document.addEventListener("keydown", (event) => event.defaultPrevented || pressed.push(event.key));
  const model = {
    get: () => undefined,
    on: (name, listener) => heard.set(listener, name),
    off: (name, listener) => heard.delete(listener),
    send: async (content) => {
      const [answer, buffers] = await window.kernel(content);
      const data = buffers.map((text) => {
        // as a front end hands it over: a view into a longer message, at any place
        const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
        const message = new Uint8Array(bytes.length + 7);
        message.set(bytes, 3);
        return new DataView(message.buffer, 3, bytes.length);
      });
      for (const [listener, name] of heard) if (name === "msg:custom") listener(answer, data);
    },
  };
  const module = await import(URL.createObjectURL(new Blob([script], { type: "text/javascript" })));
  window.leave = module.default.render({ model, el: document.getElementById("cell") });
}"""


class Kernel:
    """Answers as the widget does.

    Args:
        story: of the run; None once it is gone.
    """

    def __init__(self, dataset: RunDataset):
        self.story, self.asked = dataset, list[dict]()

    def __call__(self, content: dict) -> tuple[dict, list[str]]:
        self.asked.append(content)
        message, buffers = answer_message(self.story, content)
        return message, [base64.b64encode(one).decode() for one in buffers]


@pytest.fixture
def kernel(tmp_path) -> Kernel:
    return Kernel(run_dataset(SmallRun(tmp_path / "small").folder, FIELD))


@pytest.fixture
def cell(page, bundle, kernel) -> Iterator[Driven]:
    """The page in a cell 520 pixels wide."""
    page.goto("about:blank")
    page.expose_function("kernel", kernel)
    page.evaluate(NOTEBOOK, list(bundle))
    yield Driven(page)


def drawn(cell: Driven) -> None:
    cell.tab.locator(".gv-time", has_text="frame").wait_for()
    cell.tab.wait_for_timeout(100)


def test_a_cell_shows_the_run(cell, kernel):
    """All comes by messages; it fits the cell and can be played by its buttons."""
    drawn(cell)
    assert {one["kind"] for one in kernel.asked} == {"manifest", "series", "grains", "frame"}
    assert len({tuple(v) for v in cell.picture()[::2, ::2].reshape(-1, 4)}) > 30
    box = cell.tab.locator(".gv").bounding_box()
    assert box["width"] <= 520 and box["height"] == pytest.approx(620, abs=2)
    outside = cell.tab.evaluate(
        """() => {
          const end = document.querySelector(".gv").getBoundingClientRect().right + 1;
          return [...document.querySelectorAll(".gv :is(button, canvas, input)")]
            .filter((e) => e.checkVisibility() && e.getBoundingClientRect().right > end).map((e) => e.outerHTML);
        }"""
    )
    assert outside == [] and not cell.tab.locator(".gv-panel").is_visible()
    cell.tab.get_by_role("button", name="Last frame").click()
    cell.tab.locator(".gv-time", has_text=f"frame {FRAMES - 1} of").wait_for()
    assert cell.tab.get_by_role("button", name="Copy the address").count() == 0
    assert cell.tab.evaluate("() => location.hash") == ""


def test_keys_belong_to_the_cell_that_has_the_focus(cell):
    """In the cell they play; elsewhere they are the notebook's, and the notebook is asked to leave ours alone."""
    drawn(cell)
    cell.tab.keyboard.press("ArrowLeft")
    assert "frame 7 of" in cell.text(".gv-time")
    assert cell.tab.evaluate("() => pressed") == ["ArrowLeft"]
    cell.tab.locator("canvas.gv-canvas").focus()
    cell.tab.keyboard.press("ArrowLeft")
    cell.tab.locator(".gv-time", has_text="frame 6 of").wait_for()
    assert cell.tab.evaluate("() => pressed") == ["ArrowLeft"]
    assert cell.tab.locator(".gv").get_attribute("data-lm-suppress-shortcuts") == "true"


def test_the_notebook_keeps_its_looks(cell):
    """The page's styles are for what is inside it."""
    drawn(cell)
    assert cell.tab.locator("body > h1").evaluate("(e) => getComputedStyle(e).fontSize") == "32px"


def test_numbers_of_a_cluster_come_from_the_kernel(cell, kernel):
    drawn(cell)
    cell.tab.locator(".gv-legend button").first.click()
    cell.tab.locator(".gv-inspector", has_text="fractal dimension").wait_for()
    cell.tab.wait_for_timeout(100)
    assert "dimension" in {one["kind"] for one in kernel.asked}
    assert "…" not in cell.text(".gv-inspector")


def test_leaving_ends_it(cell, kernel):
    """Nothing listens any more, and nothing is asked."""
    drawn(cell)
    assert cell.tab.evaluate("() => heard.size") == 1
    cell.tab.get_by_role("button", name="Play").click()
    cell.tab.evaluate("() => { leave(); document.getElementById('cell').remove(); }")
    cell.tab.wait_for_timeout(100)
    assert cell.tab.evaluate("() => heard.size") == 0
    asked = len(kernel.asked)
    cell.tab.wait_for_timeout(300)
    assert len(kernel.asked) == asked


def test_a_frame_that_cannot_be_had(cell, kernel, monkeypatch):
    """The kernel's sentence is on the page."""
    drawn(cell)

    def broken(k: int) -> bytes:
        raise BadInput(f"frame {k} is not whole")

    monkeypatch.setattr(kernel.story, "frame", broken)
    cell.tab.get_by_role("button", name="Previous frame").click()
    cell.tab.locator(".gv-note", has_text="frame 6 is not whole").wait_for()
