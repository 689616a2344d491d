"""The picture of a run looks as it did when somebody last looked at it.

SAND_KEEP_PICTURES=1 makes the pictures anew; whoever does so looks at them before they are committed.

What is drawn is the same wherever SwiftShader draws; other versions of it round differently, which moves edges by less
than a pixel.  A picture of 640 × 420 is drawn twice as large and made smaller, so that an edge moved by a quarter of a
pixel there changes a pixel by an eighth of the step of colours: a mean over all pixels, of which some fifth is at an
edge, below one level, and few pixels by more than 48.  A grain of the hundred that is missing or of another colour
changes 0.1 % of all pixels.
"""

import base64
import io
import os
from pathlib import Path

import numpy as np
import pytest

from .looking import View

PICTURES = Path(__file__).parent / "pictures"
MEAN, MUCH, SHARE = 1.0, 48, 1e-3
"""Mean absolute difference in levels; what counts as another colour, and the share of pixels that may have one."""
LARGEST = 150_000
STILL = """async () => {
  const wish = { kind: "png", width: 640, height: 420, transparent: false, from: 0, to: 0 };
  const bytes = new Uint8Array(await (await sandView.exporter.image(wish)).arrayBuffer());
  let text = "";
  for (let k = 0; k < bytes.length; k += 4096) text += String.fromCharCode(...bytes.subarray(k, k + 4096));
  return btoa(text);
}"""


def differs(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether two pictures (high, wide, 3) are not of the same."""
    off = np.abs(one.astype(int) - other.astype(int)).max(-1)
    return bool(off.mean() > MEAN or (off > MUCH).mean() > SHARE)


@pytest.mark.parametrize("kind", ["two", "hundred", "ten-thousand"])
def test_the_picture_equals_the_stored_one(page, shows, kind):
    from PIL import Image

    view = View(page, shows(kind), frame=1, theme="light")
    png = base64.b64decode(view.page.evaluate(STILL))
    now, kept = Image.open(io.BytesIO(png)).convert("RGB"), PICTURES / f"{kind}.png"
    if os.environ.get("SAND_KEEP_PICTURES"):
        PICTURES.mkdir(exist_ok=True)
        now.save(kept, optimize=True)
    assert kept.stat().st_size < LARGEST
    assert now.size == (640, 420)
    assert not differs(np.asarray(now), np.asarray(Image.open(kept).convert("RGB")))


def test_a_displaced_grain_is_detected(page, shows):
    """Of one hundred grains, one is displaced by its diameter: the pictures differ."""
    from PIL import Image

    view = View(page, shows("hundred"), frame=1, theme="light")
    page.evaluate("() => { const place = sandView.world.positions; place[3 * 92] += 2; sandView.refresh(); }")
    now = Image.open(io.BytesIO(base64.b64decode(view.page.evaluate(STILL)))).convert("RGB")
    assert differs(np.asarray(now), np.asarray(Image.open(PICTURES / "hundred.png").convert("RGB")))
