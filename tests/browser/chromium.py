"""The Chromium that runs the tests of the page: the system's, or one that Playwright installed.

`python -m tests.browser.chromium` prints its path, or fails with one line.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS = (
    # WebGL 2 by SwiftShader on the CPU: the same picture on every machine, with or without a GPU
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-dev-shm-usage",  # /dev/shm is small in containers
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",  # the page must need no network
)


def find() -> str | None:
    """Path of a Chromium, or None.  Downloads nothing; ImportError without Playwright."""
    for name in NAMES:
        if path := shutil.which(name):
            return path
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        path = playwright.chromium.executable_path
    return path if Path(path).is_file() else None


if __name__ == "__main__":
    found = find()
    if not found:
        sys.exit(f"no Chromium: none of {', '.join(NAMES)} in PATH, nor one of Playwright's")
    print(found)
