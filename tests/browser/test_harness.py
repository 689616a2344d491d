"""The browser supports what the page needs, and errors in it are detected."""

import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import pytest

from .conftest import page_of

HTML = """<!doctype html><meta charset="utf-8"><link rel="icon" href="data:,"><title>x</title>
<script type="module">document.title = String([1, 2, 3].at(-1))</script>"""
RENDERER = """() => {
  const gl = document.createElement("canvas").getContext("webgl2");
  if (!gl) return null;
  const names = gl.getExtension("WEBGL_debug_renderer_info");
  return gl.getParameter(names ? names.UNMASKED_RENDERER_WEBGL : gl.RENDERER);
}"""


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


@pytest.fixture
def address(tmp_path):
    """Of a folder with index.html, served on this machine."""
    (tmp_path / "index.html").write_text(HTML)
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(tmp_path)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}/"
    server.shutdown()
    server.server_close()


def test_webgl_2_is_drawn_by_software(page):
    renderer = page.evaluate(RENDERER)
    assert renderer and "swiftshader" in renderer.lower(), renderer


def test_scripts_run_in_served_pages(page, address):
    page.goto(address)
    assert page.title() == "3"


def test_scripts_run_in_files(page, tmp_path):
    """A module within the file runs there; one beside it would not."""
    (tmp_path / "one.html").write_text(HTML)
    page.goto((tmp_path / "one.html").as_uri())
    assert page.title() == "3"


@pytest.mark.parametrize(
    ("script", "told"),
    [
        ("console.error('not well')", ["console: not well"]),
        ("setTimeout(() => { throw new Error('thrown') })", ["exception: thrown"]),
        ("fetch('http://127.0.0.1:9/').catch(() => 0)", ["request: http://127.0.0.1:9/", "console: Failed to load"]),
        ("fetch('http://localhost.invalid/').catch(() => 0)", ["stranger: http", "request: http", "console: Failed"]),
        ("fetch('nothing-here')", ["console: Failed to load resource: the server responded with a status of 404"]),
    ],
)
def test_errors_are_detected(page, address, script, told):
    """All expected errors must occur, or the fixture fails the test."""
    page.goto(address)
    page.evaluate(f"() => {{ {script} }}")
    page.expected_errors = told
    for _ in range(100):
        if all(any(word in error for error in page.errors) for word in told):
            break
        page.wait_for_timeout(50)


@pytest.mark.parametrize(("expected", "wrong"), [([], "not well"), (["not well", "more"], "more")])
def test_the_fixture_fails_the_test(browser, expected, wrong):
    """For an unexpected error, and for an expected one that did not occur."""
    tabs = page_of(browser)
    tab = next(tabs)
    tab.evaluate("() => console.error('not well')")
    tab.expected_errors = expected
    with pytest.raises(AssertionError, match=wrong):
        next(tabs)


def test_requests_that_the_page_gives_up_are_no_errors(page, address):
    page.goto(address)
    page.evaluate(
        """async () => {
          const stop = new AbortController();
          const asked = fetch("index.html", { signal: stop.signal }).catch((error) => error.name);
          stop.abort();
          return asked;
        }"""
    )
