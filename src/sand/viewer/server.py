"""The server of `sand view`: loopback only, one run, for those who know its token.

It hands out what is in `Server.ADDRESSES` and nothing else; no file's name is ever made from an address.  The token
keeps out other users of the machine, and other pages in the browser; `Host` is looked at against names that are made to
point here.
"""

from __future__ import annotations

import contextlib
import hmac
import json
import os
import re
import secrets
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from socketserver import TCPServer
from typing import Any

from ..errors import BadInput
from ..io.page_bundle import read_bundle
from ..io.run_folder import plain
from .dataset import RunDataset
from .html import SERVED, served

LOOPBACK = "127.0.0.1"
LONGEST = 512
"""Characters of an address."""
PATIENCE = 30.0
"""Seconds that a client may be silent for."""
USUAL_PORT = 80
"""Of http: addresses and hosts do not name it."""
AT_ONCE = 64
"""Connections; for one more, that which has been silent for longest is closed."""
BOTH_WAYS = 2
"""What SHUT_RDWR is everywhere."""
HEADERS = {
    "Content-Security-Policy": SERVED,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Embedder-Policy": "require-corp",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
JSON, BINARY = "application/json", "application/octet-stream"
_NUMBER = "([0-9]{1,9})"


class Refused(Exception):
    """An answer that is none: status and why."""

    def __init__(self, status: int, why: str):
        super().__init__(why)
        self.status = status


def own_names(port: int) -> set[str]:
    """Hosts that the server answers to; browsers leave out the port that is the usual one."""
    bare = (LOOPBACK, "localhost")
    return {f"{name}:{port}" for name in bare} | (set(bare) if port == USUAL_PORT else set())


class Server(ThreadingHTTPServer):
    """Tells a story to a browser on this machine.

    Parameters
    ----------
    story : Story
        of a run.
    port : int, optional
        a free one by default.

    Raises
    ------
    BadInput
        the port is taken or forbidden; the page is missing.
    """

    daemon_threads = True
    block_on_close = False
    allow_reuse_address = os.name == "posix"  # elsewhere it would let others take the port over
    request_queue_size = AT_ONCE

    def __init__(self, story: RunDataset, port: int = 0):
        script, styles = read_bundle()
        self.story, self.token = story, secrets.token_urlsafe(24)
        self._lines: dict[int, _Line] = {}
        self._lock = threading.Lock()
        self._files = {
            "": ("text/html; charset=utf-8", served(f"{story.name} – SAND")),
            "grainview.js": ("text/javascript; charset=utf-8", script),
            "grainview.css": ("text/css; charset=utf-8", styles),
        }
        try:
            super().__init__((LOOPBACK, port), _Handler)
        except (OSError, OverflowError) as error:
            why = getattr(error, "strerror", None) or error
            raise BadInput(f"cannot listen at port {port} ({why}); give another --port, or leave it out") from None
        self.port = int(self.server_address[1])
        self.names = own_names(self.port)

    def server_bind(self) -> None:
        """Without asking anybody for this machine's name."""
        TCPServer.server_bind(self)
        self.server_name, self.server_port = LOOPBACK, int(self.server_address[1])

    @property
    def url(self) -> str:
        """The address of the page."""
        return f"http://{LOOPBACK}:{self.port}/{self.token}/"

    def start(self) -> None:
        """Answer in the background."""
        threading.Thread(target=self.serve_forever, kwargs={"poll_interval": 0.1}, daemon=True).start()

    def stop(self) -> None:
        """Answer no more."""
        self.shutdown()
        self.server_close()

    def process_request(self, request: Any, client_address: Any) -> None:
        """In a thread of its own; where there are AT_ONCE of them, one that waits for its client is ended first."""
        with self._lock:
            if len(self._lines) >= AT_ONCE:
                silent = [line for line in self._lines.values() if not line.busy]
                if not silent:  # all are being answered, which is soon over
                    self.shutdown_request(request)
                    return
                self._close(min(silent, key=lambda line: (line.trusted, line.since)))
            self._lines[id(request)] = _Line(request)
        super().process_request(request, client_address)

    def _close(self, line: _Line) -> None:
        """End a connection; its thread wakes up and finds that out."""
        self._lines.pop(id(line.request), None)
        with contextlib.suppress(OSError):
            line.request.shutdown(BOTH_WAYS)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """What the thread does."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            with self._lock:
                line = self._lines.get(id(request))
                if line is not None and line.request is request:
                    del self._lines[id(request)]

    def note(self, request: Any, *, busy: bool, trusted: bool = False) -> None:
        """What a connection does from now on.

        Parameters
        ----------
        busy : bool
            an answer is being worked out; otherwise its client is waited for.
        trusted : bool, optional
            it has named the token.
        """
        line = self._lines.get(id(request))
        if line is not None and line.request is request:
            line.busy, line.since, line.trusted = busy, time.monotonic(), line.trusted or trusted

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A client that went away is nobody's trouble."""

    def answer(self, address: str, query: str) -> tuple[str, bytes]:
        """Type and content of what lies at an address below the token.

        Raises
        ------
        Refused
            nothing does, or it cannot be had.
        """
        if address in self._files and not query:
            kind, text = self._files[address]
            return kind, text.encode()
        for pattern, wanted, reply in self.ADDRESSES:
            found, asked = re.fullmatch(pattern, address), re.fullmatch(wanted, query)
            if found and asked:
                try:
                    return reply(self, *(int(number) for number in found.groups() + asked.groups() if number))
                except BadInput as error:
                    raise Refused(500, str(error)) from None
        raise Refused(404, "there is nothing at this address")

    def _manifest(self, since: int = 0) -> tuple[str, bytes]:
        self.story.refresh()
        return JSON, _json(self.story.manifest(since))

    def _grains(self) -> tuple[str, bytes]:
        return BINARY, self.story.grains()

    def _series(self) -> tuple[str, bytes]:
        return JSON, _json(self.story.series())

    def _frame(self, k: int) -> tuple[str, bytes]:
        self._there(k)
        return BINARY, self.story.frame(k)

    def _dimension(self, k: int, grain: int) -> tuple[str, bytes]:
        self._there(k, grain)
        return JSON, _json(self.story.dimension(k, grain))

    def _there(self, k: int, grain: int = 0) -> None:
        if k >= len(self.story):
            raise Refused(404, f"there are {len(self.story)} frames; there is no frame {k}")
        if grain >= self.story.grains_count:
            raise Refused(404, f"there are {self.story.grains_count} grains; there is no grain {grain}")

    ADDRESSES: tuple[tuple[str, str, Callable[..., tuple[str, bytes]]], ...] = (
        ("manifest", f"(?:since={_NUMBER})?", _manifest),
        ("grains", "", _grains),
        ("series", "", _series),
        (f"frame/{_NUMBER}", "", _frame),
        (f"dimension/{_NUMBER}/{_NUMBER}", "", _dimension),
    )


def _json(content: dict[str, Any]) -> bytes:
    return json.dumps(plain(content), allow_nan=False, separators=(",", ":")).encode()


@dataclass
class _Line:
    """A connection, and since when it does what it does."""

    request: Any
    since: float = field(default_factory=time.monotonic)
    busy: bool = False
    trusted: bool = False


class _Handler(BaseHTTPRequestHandler):
    """One connection."""

    server: Server
    timeout = PATIENCE
    protocol_version = "HTTP/1.1"
    server_version, sys_version = "SAND", ""

    def do_GET(self) -> None:
        try:
            asked = self._asked()
            self.server.note(self.request, busy=True, trusted=True)
            try:
                kind, content = self.server.answer(*asked)
            finally:
                self.server.note(self.request, busy=False)
            self._send(200, kind, content)
        except Refused as refused:
            self._send(refused.status, JSON, _json({"error": str(refused)}))
        except OSError:  # the client has gone
            self.close_connection = True
        except Exception as error:
            self._send(500, JSON, _json({"error": f"internal error ({type(error).__name__}: {error})"}))

    do_HEAD = do_GET

    def _asked(self) -> tuple[str, str]:
        """Address below the token, and query, of a request that may be answered.  Raises Refused."""
        if len(self.path) > LONGEST:
            raise Refused(414, "this address is too long")
        if self.headers.get_all("Host", []) not in [[name] for name in self.server.names]:
            raise Refused(403, "this server is for its own address only")
        if self.headers.get("Origin") not in (None, *(f"http://{name}" for name in self.server.names)):
            raise Refused(403, "this server is for its own page only")
        path, _, query = self.path.partition("?")
        token, slash, address = path.removeprefix("/").partition("/")
        if not path.startswith("/") or not hmac.compare_digest(token.encode(), self.server.token.encode()):
            raise Refused(403, "this address lacks the right token: take the one that sand view printed")
        if not slash:
            raise Refused(404, "there is nothing at this address; it ends with a slash")
        return address, query

    def _send(self, status: int, kind: str, content: bytes) -> None:
        if self.headers is None or "Content-Length" in self.headers or "Transfer-Encoding" in self.headers:
            self.close_connection = True  # what it sends besides is not read
        self.send_response(status)
        for name, value in {**HEADERS, "Content-Type": kind, "Content-Length": str(len(content))}.items():
            self.send_header(name, value)
        if status == 405:
            self.send_header("Allow", "GET, HEAD")
        if self.close_connection:
            self.send_header("Connection", "close")
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(content)

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """What the base class finds wrong."""
        self.close_connection = True
        if not hasattr(self, "headers"):
            self.headers = None  # type: ignore[assignment]
        if code == 501:
            self._send(405, JSON, _json({"error": "GET and HEAD are all that this server knows"}))
        else:
            self._send(int(code), JSON, _json({"error": message or "this is not a request"}))

    def log_message(self, format: str, *args: Any) -> None:
        """Nothing is printed."""
