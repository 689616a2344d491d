"""HTTP server of `sand view` for one run, on the loopback address only.

Every address begins with a secret token, which keeps out other users of the machine and other pages in the browser. The
`Host` header must name this machine, which defeats DNS rebinding. No file name is ever made from an address. The length
of addresses, the number of connections and the time a client may be silent are limited; when all connections are in
use, a new one takes the place of that whose client is awaited longest. Requests with a body are refused.
"""

from __future__ import annotations

import contextlib
import hmac
import os
import re
import secrets
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from socketserver import TCPServer
from typing import Any

from ..basics.errors import BadInput, NoSuchKey
from ..io.page_bundle import read_bundle
from .dataset import RunDataset
from .html import SERVED_POLICY, served_page
from .packets import compact_json

LOOPBACK = "127.0.0.1"
HOSTS = (LOOPBACK, "localhost")
"""Accepted host names."""
MAX_ADDRESS = 512
"""Maximum number of characters of an address."""
MAX_CONNECTIONS = 64
"""Connections at a time."""
CLOSING_TIME = 1.0
"""Longest time [s] until a connection that gives way to a new one has ended."""
CLIENT_TIMEOUT = 30.0
"""Seconds after which the connection of a silent client is closed."""
BOTH_WAYS = 2
"""`socket.SHUT_RDWR`."""
HEADERS = {
    "Content-Security-Policy": SERVED_POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}
JSON, BINARY = "application/json", "application/octet-stream"
_NUMBER = "([0-9]{1,9})"
_REQUEST = re.compile(
    rf"(manifest)(?:\?since={_NUMBER})?|(grains)|(series)|(frame)/{_NUMBER}|(dimension)/{_NUMBER}/{_NUMBER}"
)
"""Address and query of each of `dataset.REQUESTS`."""


class HTTPError(Exception):
    """An error response; its arguments are a status code and a message."""


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
        self._awaited: dict[Any, None] = {}  # connections whose client is awaited, the longest first
        self._lock = threading.Lock()
        self._files = {
            "": ("text/html; charset=utf-8", served_page(dataset.name)),
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
        """Serve a connection in a thread of its own, up to MAX_CONNECTIONS at a time.

        If all are in use, the one that has waited longest for its client gives way, so that slow clients lock nobody
        out; the new one is closed if no client is awaited.
        """
        free = self._free_connections.acquire(blocking=False)
        if not free and self._close_slowest():
            free = self._free_connections.acquire(timeout=CLOSING_TIME)
        if free:
            super().process_request(request, client_address)
        else:
            self.shutdown_request(request)

    def _close_slowest(self) -> bool:
        """Close the connection whose client has been awaited longest; returns whether there is one."""
        with self._lock:
            slowest = next(iter(self._awaited), None)
            if slowest is not None:
                del self._awaited[slowest]
                with contextlib.suppress(OSError):
                    slowest.shutdown(BOTH_WAYS)
        return slowest is not None

    def await_client(self, connection: Any, awaited: bool) -> None:
        """Note that a connection waits from now on for its client, to send a request or to take an answer, or not."""
        with self._lock:
            self._awaited.pop(connection, None)
            if awaited:
                self._awaited[connection] = None

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Serve a connection and count it as free again."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free_connections.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Print nothing when a client disconnects."""

    def respond(self, address: str) -> tuple[str, bytes]:
        """Content type and content for an address below the token, with its query.

        Raises
        ------
        HTTPError
            404 if the address is unknown, 500 if the data cannot be read.
        """
        if address in self._files:
            content_type, text = self._files[address]
            return content_type, text.encode()
        if (request := _REQUEST.fullmatch(address)) is None:
            raise HTTPError(404, "unknown address")
        kind, *numbers = (group for group in request.groups() if group)
        try:
            answer = self.dataset.answer(kind, *map(int, numbers))
        except BadInput as error:
            raise HTTPError(404 if isinstance(error, NoSuchKey) else 500, str(error)) from None
        return (BINARY, answer) if isinstance(answer, bytes) else (JSON, compact_json(answer).encode())


class _Handler(BaseHTTPRequestHandler):
    """One connection."""

    server: Server
    timeout = CLIENT_TIMEOUT
    protocol_version = "HTTP/1.1"
    server_version, sys_version = "SAND", ""

    def handle_one_request(self) -> None:
        """Wait for a request and answer it."""
        self.server.await_client(self.connection, True)
        try:
            super().handle_one_request()
        finally:
            self.server.await_client(self.connection, False)

    def do_GET(self) -> None:
        self.server.await_client(self.connection, False)
        try:
            status, (content_type, content) = 200, self.server.respond(self._checked_address())
        except Exception as error:
            internal = (500, f"internal error ({type(error).__name__}: {error})")
            status, message = error.args if isinstance(error, HTTPError) else internal
            content_type, content = JSON, compact_json({"error": message}).encode()
            self.close_connection = True  # what follows may be the body of a refused request
        self.server.await_client(self.connection, True)
        self.send_response(status)
        if self.close_connection:
            self.send_header("Connection", "close")
        for name, value in {**HEADERS, "Content-Type": content_type, "Content-Length": str(len(content))}.items():
            self.send_header(name, value)
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(content)

    do_HEAD = do_GET  # noqa: N815, a name of http.server

    def _checked_address(self) -> str:
        """Address below the token, with its query; HTTPError if it has a body, or length, host or token are wrong."""
        sizes = self.headers.get_all("Content-Length", [])
        if any(size != "0" for size in sizes) or "Transfer-Encoding" in self.headers or self.headers.defects:
            raise HTTPError(400, "requests to this server have no body, and no malformed headers")
        if len(self.path) > MAX_ADDRESS:
            raise HTTPError(414, f"the address is longer than {MAX_ADDRESS} characters")
        hosts = self.headers.get_all("Host", [])
        if len(hosts) != 1 or hosts[0].partition(":")[0] not in HOSTS:
            raise HTTPError(403, f"this server answers requests to {' and '.join(HOSTS)} only")
        token, slash, address = self.path.removeprefix("/").partition("/")
        if not hmac.compare_digest(token.encode(), self.server.token.encode()):
            raise HTTPError(403, "wrong access token: open the address printed by sand view")
        if not slash:
            raise HTTPError(404, "unknown address; the address of the page ends with a slash")
        return address

    def log_message(self, format: str, *args: Any) -> None:
        """Print nothing."""
