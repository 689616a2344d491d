"""The server of `sand view`: access, addresses, malformed requests, limits."""

import contextlib
import http.client
import inspect
import json
import socket
import threading
import time

import pytest

from sand.basics.errors import BadInput
from sand.viewer import server as servers
from sand.viewer.dataset import run_dataset
from sand.viewer.server import Server

from ..pages import decode
from ..synthetic_trajectories import write_trajectory

BUNDLE = ("console.log(1)\n", "body {}\n")


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    """A server of three frames."""
    patch = pytest.MonkeyPatch()
    patch.setattr(servers, "read_bundle", lambda: BUNDLE)
    path = write_trajectory(tmp_path_factory.mktemp("served") / "a.gsd", [[], [(0, 1)], [(0, 1), (1, 2)]], 5)
    one = Server(run_dataset(path))
    one.start()
    yield one
    one.stop()
    patch.undo()


def ask(server, address, method="GET", headers=None, token=None):
    """Status, headers and content of a response."""
    line = http.client.HTTPConnection("127.0.0.1", server.port, timeout=10)
    line.putrequest(method, f"/{server.token if token is None else token}/{address}", skip_host=True)
    for name, value in {"Host": f"127.0.0.1:{server.port}", **(headers or {})}.items():
        line.putheader(name, value)
    line.endheaders()
    reply = line.getresponse()
    content = reply.read()
    line.close()
    return reply.status, reply.headers, content


def raw(server, text):
    """Response on a socket to these bytes."""
    with socket.create_connection(("127.0.0.1", server.port), timeout=10) as line:
        line.sendall(text)
        line.shutdown(socket.SHUT_WR)
        return b"".join(iter(lambda: line.recv(65536), b""))


def test_responses(server):
    """Page, script, styles, manifest, grains, frames, series, dimensions: content types and the dataset's bytes."""
    status, headers, page = ask(server, "")
    assert status == 200 and headers["Content-Type"].startswith("text/html") and b'<div id="grainview">' in page
    assert (ask(server, "grainview.js")[2].decode(), ask(server, "grainview.css")[2].decode()) == BUNDLE
    assert ask(server, "grainview.js")[1]["Content-Type"].startswith("text/javascript")
    assert ask(server, "grainview.css")[1]["Content-Type"].startswith("text/css")
    manifest = json.loads(ask(server, "manifest")[2])
    assert manifest["grains"] == 5 and len(manifest["times"]) == 3
    assert len(json.loads(ask(server, "manifest?since=2")[2])["times"]) == 1
    assert decode(ask(server, "frame/2")[2])[1]["pair"].tolist() == [[0, 1], [1, 2]]
    assert len(decode(ask(server, "grains")[2])[1]["radius"]) == 5
    assert json.loads(ask(server, "series")[2])["plots"]
    assert "at least 32" in json.loads(ask(server, "dimension/2/0")[2])["reason"]


def test_a_head_has_no_body(server):
    """HEAD answers with the headers of GET and nothing else."""
    status, headers, content = ask(server, "frame/1", "HEAD")
    assert (status, content) == (200, b"")
    assert int(headers["Content-Length"]) == len(ask(server, "frame/1")[2])


def test_security_headers(server):
    """The page loads its own resources only, no other page may embed it, no caching; also for errors."""
    for address in ("", "manifest", "nothing"):
        headers = ask(server, address)[1]
        policy = headers["Content-Security-Policy"]
        assert "default-src 'none'" in policy and "frame-ancestors 'none'" in policy
        assert "unsafe" not in policy and "*" not in policy and "http" not in policy
        assert headers["X-Content-Type-Options"] == "nosniff"
        assert headers["Referrer-Policy"] == "no-referrer"
        assert headers["Cache-Control"] == "no-store"
        assert "Access-Control-Allow-Origin" not in headers
        assert "Python" not in headers["Server"]


@pytest.mark.parametrize("token", ["", "x", "%2e%2e", "..", "é" * 32])
def test_a_wrong_token(server, token):
    """Without the token every address gives the same refusal."""
    for address in ("", "manifest", "frame/0", "nowhere"):
        line = f"GET /{token}/{address} HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n\r\n"
        head, _, content = raw(server, line.encode()).partition(b"\r\n\r\n")
        assert b" 403 " in head.splitlines()[0] and "token" in json.loads(content)["error"]


def test_tokens_are_new_each_time(server):
    """Tokens are long, and differ between servers."""
    other = Server(server.dataset)
    other.server_close()
    assert len(other.token) >= 32 and other.token != server.token


def test_the_server_listens_on_localhost_only(server):
    """The socket is bound to 127.0.0.1; another loopback address is refused.

    The constructor takes a dataset and a port only: no setting opens the server to other machines.
    """
    assert server.socket.family == socket.AF_INET and server.socket.getsockname() == ("127.0.0.1", server.port)
    with pytest.raises(OSError), socket.create_connection(("127.0.0.2", server.port), timeout=5):
        pass
    assert list(inspect.signature(Server).parameters) == ["dataset", "port"]


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:{port}", "127.0.0.1.evil.example", "0.0.0.0:{port}", ""]
)
def test_foreign_host_names_are_refused(server, host):
    """A host name that resolves to 127.0.0.1 is refused even with the token (DNS rebinding)."""
    status, _, content = ask(server, "manifest", headers={"Host": host.format(port=server.port)})
    assert status == 403 and json.loads(content)["error"]


def test_own_host_names(server):
    """127.0.0.1 and localhost, with or without the port; not two hosts, not none."""
    for host in (f"localhost:{server.port}", "localhost", "127.0.0.1"):
        assert ask(server, "manifest", headers={"Host": host})[0] == 200
    path = f"GET /{server.token}/manifest HTTP/1.1\r\n".encode()
    host = f"Host: 127.0.0.1:{server.port}\r\n".encode()
    assert b" 200 " in raw(server, path + host + b"Connection: close\r\n\r\n").splitlines()[0]
    assert b" 403 " in raw(server, path + b"\r\n").splitlines()[0]
    assert b" 403 " in raw(server, path + host + b"Host: evil.example\r\n\r\n").splitlines()[0]


@pytest.mark.parametrize(
    "address",
    [
        "nothing",
        "../../etc/passwd",
        "..%2f..%2fetc/passwd",
        "%2e%2e/a.gsd",
        "a.gsd",
        "./grainview.js",
        "grainview.js/",
        "grainview.js?x=1",
        "/etc/passwd",
        "frame",
        "frame/",
        "frame/-1",
        "frame/3",
        "frame/99999999999999999999",
        "frame/1.0",
        "frame/0x1",
        "frame/1e0",
        "frame/+1",
        "frame/1/2",
        "frame/%31",
        "frame/٣",
        "manifest?since=-1",
        "manifest?since=x",
        "manifest?since=1&since=2",
        "manifest?a=1",
        "dimension/0",
        "dimension/0/5",
        "dimension/3/0",
        "dimension/0/0/0",
        "grains?x",
        "series/",
        "//manifest",
        "manifest%00",
        "?since=1",
    ],
)
def test_unknown_addresses(server, address):
    """Anything else is 404 and a sentence: other files, dots, frame numbers that are malformed or too large."""
    line = f"GET /{server.token}/{address} HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n\r\n"
    head, _, content = raw(server, line.encode()).partition(b"\r\n\r\n")
    assert b" 404 " in head.splitlines()[0] and json.loads(content)["error"]


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS", "PATCH", "TRACE", "CONNECT", "FOO"])
def test_other_methods(server, method):
    """Only GET and HEAD are answered."""
    status, _, content = ask(server, "manifest", method)
    assert status == 501 and server.token.encode() not in content


def test_long_addresses(server):
    """Above 512 characters, and above the length of a request line."""
    assert ask(server, "frame/" + "0" * 600)[0] == 414
    assert b" 414 " in raw(server, b"GET /" + b"a" * 70000 + b" HTTP/1.1\r\n\r\n").splitlines()[0]


@pytest.mark.parametrize(
    "text", [b"\r\n\r\n", b"\x16\x03\x01\x02\x00", b"GET\r\n\r\n", b"GET / HTTP/9.9\r\n\r\n", b"x" * 5000]
)
def test_malformed_requests(server, text):
    """Malformed bytes end the connection; nothing is printed."""
    raw(server, text)
    assert ask(server, "manifest")[0] == 200


def test_slow_clients_do_not_block_others(server, capfd):
    """While some send nothing or half a request, others are answered; nothing is printed when they leave."""
    slow = [socket.create_connection(("127.0.0.1", server.port)) for _ in range(10)]
    for line in slow:
        line.sendall(b"GET /")
    begun = time.monotonic()
    assert ask(server, "frame/1")[0] == 200
    assert time.monotonic() - begun < 5.0
    for line in slow:
        line.close()
    assert ask(server, "frame/1")[0] == 200
    output = capfd.readouterr()
    assert output.out == output.err == ""


@pytest.fixture
def small(server, monkeypatch):
    """A server that takes two connections at a time."""
    monkeypatch.setattr(servers, "MAX_CONNECTIONS", 2)
    one = Server(server.dataset)
    one.start()
    yield one
    one.stop()


def wait_until(holds):
    deadline = time.monotonic() + 10.0
    while not holds() and time.monotonic() < deadline:
        time.sleep(0.01)
    assert holds()


@pytest.mark.parametrize("text", [b"", b"GET /", b"GET / HTTP/1.1\r\nHost: a\r\n"])
def test_slow_clients_give_way(small, text):
    """With all connections in use by clients that finish no request, the one that is awaited longest is closed."""
    slow = []
    for _ in range(2):
        slow.append(socket.create_connection(("127.0.0.1", small.port), timeout=10))
        slow[-1].sendall(text)
        wait_until(lambda: len(small._awaited) == len(slow))
    assert ask(small, "frame/1")[0] == 200
    assert slow[0].recv(100) == b""
    slow[1].sendall(b"\r\n\r\n")
    assert slow[1].recv(100) != b"" or not text
    for line in slow:
        line.close()


def test_the_number_of_connections_is_limited(small, monkeypatch):
    """While all connections compute answers another is closed; when they end, requests are answered again."""
    may_answer, computing = threading.Event(), []

    def answer(*_):
        computing.append(1)
        return may_answer.wait(10.0) and b""

    monkeypatch.setattr(small.dataset, "answer", answer)
    head = f"GET /{small.token}/manifest HTTP/1.1\r\nHost: localhost\r\n\r\n".encode()
    busy = [socket.create_connection(("127.0.0.1", small.port), timeout=10) for _ in range(2)]
    for line in busy:
        line.sendall(head)
    wait_until(lambda: len(computing) == 2)
    with pytest.raises((http.client.HTTPException, ConnectionError)):
        ask(small, "manifest")
    may_answer.set()
    assert [line.recv(15) for line in busy] == [b"HTTP/1.1 200 OK"] * 2
    for line in busy:
        line.close()

    def is_answered():
        with contextlib.suppress(http.client.HTTPException, ConnectionError):  # before the two threads have ended
            return ask(small, "frame/1")[0] == 200
        return False

    wait_until(is_answered)


@pytest.mark.parametrize(
    "header", ["Content-Length: {}", "Transfer-Encoding: chunked", "Content-Length : {}", "Content-Length: 0, {}"]
)
def test_a_request_in_a_body_is_not_answered(server, header):
    """A request with a body is refused, and the connection closed, so that nothing in the body is taken for another."""
    hidden = f"GET /{server.token}/manifest HTTP/1.1\r\nHost: localhost\r\n\r\n"
    first = hidden[:-2] + header.format(len(hidden)) + "\r\n\r\n"
    answers = raw(server, (first + hidden).encode())
    assert answers.count(b"HTTP/1.1") == 1 and b" 400 " in answers.splitlines()[0]
    assert b"Connection: close" in answers and server.token.encode() not in answers


def test_several_requests_on_one_connection(server):
    """Requests without a body are answered one after the other, also with a length of 0."""
    one = f"GET /{server.token}/manifest HTTP/1.1\r\nHost: localhost\r\nContent-Length: 0\r\n\r\n"
    assert raw(server, (one + one).encode()).count(b"HTTP/1.1 200 OK") == 2


def test_an_unreadable_frame(server, monkeypatch):
    """A damaged frame gives a sentence and status 500; so does an unexpected error."""
    monkeypatch.setattr(server.dataset, "frame", lambda k: (_ for _ in ()).throw(BadInput("frame 1 is broken")))
    status, _, content = ask(server, "frame/1")
    assert status == 500 and json.loads(content) == {"error": "frame 1 is broken"}
    monkeypatch.setattr(server.dataset, "frame", lambda k: 1 / 0)
    status, _, content = ask(server, "frame/1")
    assert status == 500 and "ZeroDivisionError" in json.loads(content)["error"]


def test_a_port_that_is_taken(server):
    """One sentence that says what to do."""
    for port in (server.port, 70000):
        with pytest.raises(BadInput, match="--port"):
            Server(server.dataset, port)
