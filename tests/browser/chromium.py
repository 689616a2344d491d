"""The Chromium that runs the tests of the page: that of films, the system's or one that Playwright installed.

`python -m tests.browser.chromium` prints its path, or fails with one line.
"""

from __future__ import annotations

import sys

from sand.viewer.headless import FLAGS, NAMES
from sand.viewer.headless import find_chromium as find

__all__ = ["FLAGS", "find"]

if __name__ == "__main__":
    found = find()
    if not found:
        sys.exit(f"no Chromium: none of {', '.join(NAMES)} in PATH, nor one of Playwright's")
    print(found)
