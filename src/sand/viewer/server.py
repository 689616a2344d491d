"""HTTP server of `sand view` for one run, on the loopback address only.

Every address begins with a secret token, which keeps out other users of the machine and other pages in the browser. The
`Host` header must name this machine, which defeats DNS rebinding. No file name is ever made from an address. The length
of addresses, the number of connections and the time a client may be silent are limited.
"""

from __future__ import annotations

import hmac
import json
import os
import re
import secrets
import threading
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from socketserver import TCPServer
from typing import Any

from ..errors import BadInput
from ..io.page_bundle import read_bundle
from ..io.run_folder import plain
from .dataset import RunDataset
from .html import SERVED_POLICY, page_title, served_page

LOOPBACK = "127.0.0.1"
HOSTS = (LOOPBACK, "localhost")
"""Accepted host names."""
MAX_ADDRESS = 512
"""Maximum number of characters of an address."""
MAX_CONNECTIONS = 64
"""Further connections are closed at once."""
CLIENT_TIMEOUT = 30.0
"""Seconds after which the connection of a silent client is closed."""
HEADERS = {
    "Content-Security-Policy": SERVED_POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}
JSON, BINARY = "application/json", "application/octet-stream"
_NUMBER = "([0-9]{1,9})"


class HTTPError(Exception):
    """An error response with a status code and a message."""

    def __init__(self, status: int, message: str):
        super().__init__(message)
        self.status = status


class Server(ThreadingHTTPServer):
    """HTTP server of the viewer page and the data of a run.

    Parameters
    ----------
    dataset : RunDataset
        Data of the run.
    port : int, optional
        Port; 0 chooses a free one.

    Attributes
    ----------
    token : str
        Secret first part of every address.

    Raises
    ------
    BadInput
        If the port is not available, or the viewer page is not installed.
    """

    daemon_threads = True
    block_on_close = False
    allow_reuse_address = os.name == "posix"  # on Windows, this option would let other programs take over the port
    request_queue_size = MAX_CONNECTIONS

    def __init__(self, dataset: RunDataset, port: int = 0):
        script, styles = read_bundle()
        self.dataset, self.token = dataset, secrets.token_urlsafe(24)
        self._free_connections = threading.BoundedSemaphore(MAX_CONNECTIONS)
        self._files = {
            "": ("text/html; charset=utf-8", served_page(page_title(dataset))),
            "grainview.js": ("text/javascript; charset=utf-8", script),
            "grainview.css": ("text/css; charset=utf-8", styles),
        }
        try:
            super().__init__((LOOPBACK, port), _Handler)
        except (OSError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or error
            raise BadInput(f"cannot listen at port {port} ({reason}); give another --port, or leave it out") from None
        self.port = int(self.server_address[1])

    def server_bind(self) -> None:
        """Bind without the name lookup of the base class, which can take seconds."""
        TCPServer.server_bind(self)
        self.server_name, self.server_port = LOOPBACK, int(self.server_address[1])

    @property
    def url(self) -> str:
        """Address of the page."""
        return f"http://{LOOPBACK}:{self.port}/{self.token}/"

    def start(self) -> None:
        """Serve in a background thread."""
        threading.Thread(target=self.serve_forever, kwargs={"poll_interval": 0.1}, daemon=True).start()

    def stop(self) -> None:
        """Stop serving and close the port."""
        self.shutdown()
        self.server_close()

    def process_request(self, request: Any, client_address: Any) -> None:
        """Serve a connection in a thread of its own, up to MAX_CONNECTIONS at a time."""
        if self._free_connections.acquire(blocking=False):
            try:
                super().process_request(request, client_address)
            except BaseException:  # the thread could not be started
                self._free_connections.release()
                raise
        else:
            self.shutdown_request(request)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Serve a connection and count it as free again."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free_connections.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Print nothing when a client disconnects."""

    def respond(self, address: str, query: str) -> tuple[str, bytes]:
        """Content type and content for an address below the token.

        Raises
        ------
        HTTPError
            404 if the address is unknown, 500 if the data cannot be read.
        """
        if address in self._files and not query:
            content_type, text = self._files[address]
            return content_type, text.encode()
        for address_pattern, query_pattern, method in self.ADDRESSES:
            address_match, query_match = re.fullmatch(address_pattern, address), re.fullmatch(query_pattern, query)
            if address_match and query_match:
                numbers = [int(number) for number in address_match.groups() + query_match.groups() if number]
                try:
                    return method(self, *numbers)
                except BadInput as error:
                    raise HTTPError(500, str(error)) from None
        raise HTTPError(404, "unknown address")

    def _manifest(self, since: int = 0) -> tuple[str, bytes]:
        self.dataset.refresh()
        return JSON, _json(self.dataset.manifest(since))

    def _grains(self) -> tuple[str, bytes]:
        return BINARY, self.dataset.grains()

    def _series(self) -> tuple[str, bytes]:
        return JSON, _json(self.dataset.series())

    def _frame(self, k: int) -> tuple[str, bytes]:
        self._require(k)
        return BINARY, self.dataset.frame(k)

    def _dimension(self, k: int, grain: int) -> tuple[str, bytes]:
        self._require(k, grain)
        return JSON, _json(self.dataset.dimension(k, grain))

    def _require(self, k: int, grain: int = 0) -> None:
        frames, grains = len(self.dataset), self.dataset.grains_count
        if k >= frames:
            raise HTTPError(404, f"there is no frame {k}; there are {frames} frames")
        if grain >= grains:
            raise HTTPError(404, f"there is no grain {grain}; there are {grains} grains")

    ADDRESSES: tuple[tuple[str, str, Callable[..., tuple[str, bytes]]], ...] = (
        ("manifest", f"(?:since={_NUMBER})?", _manifest),
        ("grains", "", _grains),
        ("series", "", _series),
        (f"frame/{_NUMBER}", "", _frame),
        (f"dimension/{_NUMBER}/{_NUMBER}", "", _dimension),
    )
    """Patterns of address and query, and the method that answers them; the numbers are its arguments."""


def _json(content: dict[str, Any]) -> bytes:
    return json.dumps(plain(content), allow_nan=False, separators=(",", ":")).encode()


class _Handler(BaseHTTPRequestHandler):
    """One connection."""

    server: Server
    timeout = CLIENT_TIMEOUT
    protocol_version = "HTTP/1.1"
    server_version, sys_version = "SAND", ""

    def do_GET(self) -> None:
        try:
            self._send(200, *self.server.respond(*self._checked_address()))
        except HTTPError as error:
            self._send(error.status, JSON, _json({"error": str(error)}))
        except OSError:  # the client has disconnected
            self.close_connection = True
        except Exception as error:
            self._send(500, JSON, _json({"error": f"internal error ({type(error).__name__}: {error})"}))

    do_HEAD = do_GET  # noqa: N815, a name of http.server

    def _checked_address(self) -> tuple[str, str]:
        """Address below the token and query of the request; HTTPError if length, host or token are wrong."""
        if len(self.path) > MAX_ADDRESS:
            raise HTTPError(414, f"the address is longer than {MAX_ADDRESS} characters")
        hosts = self.headers.get_all("Host", [])
        if len(hosts) != 1 or hosts[0].partition(":")[0] not in HOSTS:
            raise HTTPError(403, f"this server answers requests to {' and '.join(HOSTS)} only")
        path, _, query = self.path.partition("?")
        token, slash, address = path.removeprefix("/").partition("/")
        if not path.startswith("/") or not hmac.compare_digest(token.encode(), self.server.token.encode()):
            raise HTTPError(403, "wrong access token: open the address printed by sand view")
        if not slash:
            raise HTTPError(404, "unknown address; the address of the page ends with a slash")
        return address, query

    def _send(self, status: int, content_type: str, content: bytes) -> None:
        if self.headers is None or "Content-Length" in self.headers or "Transfer-Encoding" in self.headers:
            self.close_connection = True  # the body of the request is not read
        self.send_response(status)
        for name, value in {**HEADERS, "Content-Type": content_type, "Content-Length": str(len(content))}.items():
            self.send_header(name, value)
        if status == 405:
            self.send_header("Allow", "GET, HEAD")
        if self.close_connection:
            self.send_header("Connection", "close")
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(content)

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """Answer an invalid request in JSON and close the connection."""
        self.close_connection = True
        if not hasattr(self, "headers"):
            self.headers = None  # type: ignore[assignment]
        if code == 501:
            self._send(405, JSON, _json({"error": "only GET and HEAD are allowed"}))
        else:
            self._send(int(code), JSON, _json({"error": message or "invalid request"}))

    def log_message(self, format: str, *args: Any) -> None:
        """Print nothing."""
