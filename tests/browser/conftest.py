"""Fixtures for tests of the page: a browser, and tabs that fail a test for any unexpected error.

Without Playwright, Chromium or the bundle the tests are skipped; SAND_NEED_BROWSER=1 makes that a failure.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

import pytest

from sand.basics.errors import BadInput
from sand.io.page_bundle import read_bundle

from .chromium import FLAGS, find
from .driving import SIZE, Driven, served
from .looking import Shows
from .small_runs import SmallRun

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page, Request

PATIENCE = 60_000  # ms, for whatever a test waits for: software draws slowly on a busy machine


def skip_or_fail(reason: str) -> None:
    """Skip the test, or fail it if SAND_NEED_BROWSER is set."""
    if os.environ.get("SAND_NEED_BROWSER"):
        pytest.fail(reason, pytrace=False)
    pytest.skip(reason)


@pytest.fixture(scope="package")
def browser() -> Iterator[Browser]:
    """Headless Chromium, one for each worker.

    Not for the whole session: while Playwright runs, asyncio has a running loop in this thread, and tests of other
    packages that start one would fail.
    """
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        skip_or_fail("Playwright is not installed: pip install -e '.[interop]'")
    path = find()
    if path is None:
        skip_or_fail("no Chromium: apt install chromium, or playwright install chromium")
    with sync_playwright() as playwright:
        # Playwright's default is no sandbox, which root and most containers need; only our own pages are opened
        started = playwright.chromium.launch(executable_path=path, headless=True, args=list(FLAGS))
        yield started
        started.close()


@pytest.fixture(scope="session")
def bundle() -> tuple[str, str]:
    """Script and style sheet of the page, as built."""
    try:
        return read_bundle()
    except BadInput as error:
        skip_or_fail(str(error))


@pytest.fixture(scope="session")
def shows(tmp_path_factory: pytest.TempPathFactory, bundle: tuple[str, str]) -> Iterator[Shows]:
    """Synthetic runs by kind (see `runs.KINDS`): `shows("two")`."""
    all_of_them = Shows(tmp_path_factory.mktemp("shows"))
    yield all_of_them
    all_of_them.close()


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    """An empty tab of 1280 × 800.

    Errors in it (console, exceptions, failed requests, requests to another machine) are collected in `page.errors`.  At
    the end of the test every entry must contain one of `page.expected_errors`, and each of these must have occurred;
    tests that provoke errors set that list.
    """
    yield from page_of(browser)


@pytest.fixture(scope="module")
def tab(browser: Browser, bundle: tuple[str, str], tmp_path_factory: pytest.TempPathFactory) -> Iterator[Driven]:
    """The page of a small run, shared by all tests of a module."""
    folder = SmallRun(tmp_path_factory.mktemp("runs") / "small").folder
    with served(folder) as server:
        pages = page_of(browser)
        page = next(pages)
        page.set_viewport_size(SIZE)
        page.context.grant_permissions(["clipboard-read", "clipboard-write"])
        yield Driven(page, server.url)
        next(pages, None)


@pytest.fixture
def view(tab: Driven) -> Driven:
    """The shared page with its initial settings."""
    tab.fresh()
    return tab


def page_of(browser: Browser, **options: Any) -> Iterator[Page]:
    """Implementation of the fixture `page`; `options` of the browser's context."""
    context = browser.new_context(viewport={"width": 1280, "height": 800}, **options)
    context.set_default_timeout(PATIENCE)
    tab = context.new_page()
    errors: list[str] = []
    tab.errors, tab.expected_errors = errors, []  # type: ignore[attr-defined]
    tab.on("console", lambda message: errors.append(f"console: {message.text}") if message.type == "error" else None)
    tab.on("pageerror", lambda error: errors.append(f"exception: {error}"))
    tab.on("requestfailed", lambda request: _record_failure(request, errors))
    tab.on("request", lambda request: _record_foreign_request(request, errors))
    yield tab
    tab.evaluate("() => new Promise(requestAnimationFrame)")  # process the browser's pending events
    expected = tab.expected_errors  # type: ignore[attr-defined]
    seen = list(errors)
    context.close()
    wrong = [error for error in seen if not any(word in error for word in expected)]
    assert not wrong, f"errors in the page: {wrong}"
    silent = [word for word in expected if not any(word in error for error in seen)]
    assert not silent, f"expected, but not seen in the page: {silent}"


def _record_failure(request: Request, errors: list[str]) -> None:
    if request.failure != "net::ERR_ABORTED":  # aborted by the page itself, as for skipped frames
        errors.append(f"request: {request.url} {request.failure}")


def _record_foreign_request(request: Request, errors: list[str]) -> None:
    parts = urlsplit(request.url)
    if parts.scheme in ("http", "https", "ws", "wss") and parts.hostname != "127.0.0.1":
        errors.append(f"stranger: {request.url}")
