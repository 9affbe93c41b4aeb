"""The server of a live page: on the loopback interface, for those who know the token.

A gate before everything looks at each request:

    Host      is this server's own: a name that someone's DNS sends here is another
    Origin    if it is given, likewise: a page from elsewhere opens no websocket
    path      the page, its websocket, and the files of Bokeh's own package, nothing else
    token     of the address, of the page and its websocket; the files are the same everywhere
    session   of a websocket: one that this server has signed, which only comes with a page

What is wrong with a request or a message is told to its sender alone: nothing of it, nor the token,
gets into a log.
"""

import hmac
import logging
import secrets
from collections.abc import Collection
from typing import Any
from urllib.parse import urlsplit

from bokeh.application import Application
from bokeh.application.handlers.function import FunctionHandler
from bokeh.server.server import BaseServer
from bokeh.server.tornado import BokehTornado
from bokeh.server.util import bind_sockets
from bokeh.util.token import check_token_signature
from tornado.httpserver import HTTPServer
from tornado.httputil import HTTPHeaders, HTTPMessageDelegate, HTTPServerRequest
from tornado.ioloop import IOLoop, PeriodicCallback
from tornado.routing import Router
from tornado.web import Application as TornadoApplication
from tornado.web import OutputTransform, RequestHandler

from configs.errors import InfrastructureError
from fleetloop.live.hub import MOST_PAGES, MOST_VIEWERS, Hub

ADDRESS = "127.0.0.1"
_MOST_MESSAGE_BYTES = 1 << 16
"""Of what a browser sends."""
_PAGE, _SOCKET, _FILES = "/", "/ws", "/static/"
_LOOK_EVERY_MS = 250
_ARGUMENTS = {_PAGE: {"token"}, _SOCKET: {"token", "bokeh-protocol-version"}}
_OF_OTHERS = "bokeh.server", "tornado.access", "tornado.general"
"""Loggers of what came from outside."""
_UNUSED_MS = 10_000
"""A session without a browser ends after this time."""


class _Refused(RequestHandler):
    """Says why not."""

    def initialize(self, status: int, why: str) -> None:
        """Args as of `_Gate`."""
        self._refusal = (status, why)

    def prepare(self) -> None:
        """Whatever the method is."""
        status, why = self._refusal
        self.set_status(status)
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(f"{why}\n")

    def data_received(self, chunk: bytes) -> None:
        """Not read."""


class _Headers(OutputTransform):
    """What every answer tells the browser: nothing from elsewhere, nothing kept, nothing told."""

    def __init__(self, request: HTTPServerRequest) -> None:
        host = request.host
        self._policy = "; ".join(
            (
                "default-src 'none'",
                "script-src 'self' 'unsafe-inline'",
                "style-src 'self' 'unsafe-inline'",
                "img-src 'self' data: blob:",
                "font-src 'self' data:",
                f"connect-src 'self' ws://{host}",
                "base-uri 'none'",
                "form-action 'none'",
                "frame-ancestors 'none'",
            )
        )
        self._page = not request.path.startswith(_FILES)

    def transform_first_chunk(
        self, status_code: int, headers: HTTPHeaders, chunk: bytes, finishing: bool
    ) -> tuple[int, HTTPHeaders, bytes]:
        """Add the headers."""
        headers["Content-Security-Policy"] = self._policy
        headers["Referrer-Policy"] = "no-referrer"
        headers["X-Content-Type-Options"] = "nosniff"
        if self._page:
            headers["Cache-Control"] = "no-store"
        return super().transform_first_chunk(status_code, headers, chunk, finishing)


class _Gate(Router):
    """Looks at each request before the application does."""

    def __init__(
        self,
        inside: TornadoApplication,
        hub: Hub,
        token: str,
        hosts: Collection[str],
        signed_with: bytes,
    ) -> None:
        self._inside = inside
        self._hub = hub
        self._token = token
        self._hosts = hosts
        self._signed_with = signed_with
        self._refusals = TornadoApplication([], transforms=[_Headers])

    def find_handler(self, request: HTTPServerRequest, **kwargs: Any) -> HTTPMessageDelegate | None:
        """Whoever answers the request."""
        refusal = self._refusal(request)
        if refusal is None:
            return self._inside.find_handler(request, **kwargs)
        status, why = refusal
        said = {"status": status, "why": why}
        return self._refusals.get_handler_delegate(request, _Refused, said)

    def _refusal(self, request: HTTPServerRequest) -> tuple[int, str] | None:
        """Status and reason of a request that goes no further."""
        if request.headers.get_list("Host") != [request.host] or request.host not in self._hosts:
            return 403, "this server has another name"
        origins = request.headers.get_list("Origin")
        if any(urlsplit(one).netloc not in self._hosts for one in origins):
            return 403, "from another origin"
        path = request.path
        if path not in (_PAGE, _SOCKET) and not path.startswith(_FILES):
            return 404, "there is nothing here"
        if request.method != "GET":
            return 405, "there is nothing to change here"
        if path.startswith(_FILES):
            return None
        given = request.query_arguments.get("token", [])
        if len(given) != 1 or not hmac.compare_digest(given[0], self._token.encode()):
            return 403, "the address lacks its token, or has a wrong one"
        if unknown := set(request.query_arguments) - _ARGUMENTS[path]:
            return 400, f"the address has more than its token: {min(unknown)[:40]!r}"
        if path == _SOCKET and not self._has_session(request.headers):
            return 403, "a websocket needs the session of a page"
        if path == _PAGE and self._hub.count_there() >= MOST_VIEWERS:
            return 503, f"{MOST_VIEWERS} viewers are there already: close one, and load this again"
        if path == _PAGE and len(self._hub.viewers) >= MOST_PAGES:
            return 503, f"loaded too often: load this again in {_UNUSED_MS // 1000} s"
        return None

    def _has_session(self, headers: HTTPHeaders) -> bool:
        """Whether a websocket comes with a session that was signed here."""
        protocol, _, session = headers.get("Sec-WebSocket-Protocol", "").partition(",")
        try:
            signed = check_token_signature(
                session.strip(), secret_key=self._signed_with, signed=True
            )
        except (ValueError, KeyError, TypeError):  # of what is no token at all
            return False
        return bool(signed) and protocol.strip() == "bokeh"


class LiveServer:
    """Serves the page of one run from the loop that runs; `stop` ends it.

    Args:
        hub: of its viewers.
        token: of the address.
        port: 0: one that is free.

    Raises:
        InfrastructureError: the port can't be had.
    """

    def __init__(self, hub: Hub, token: str, port: int = 0) -> None:
        logging.getLogger("bokeh").setLevel(logging.ERROR)
        logging.getLogger("tornado").setLevel(logging.ERROR)
        for name in _OF_OTHERS:
            logging.getLogger(name).setLevel(logging.CRITICAL)
        self._hub = hub
        try:
            sockets, self.port = bind_sockets(ADDRESS, port)
        except OSError as error:
            why = error.strerror or error
            raise InfrastructureError(f"{ADDRESS}:{port}: can't serve there: {why}") from error
        hosts = [f"{name}:{self.port}" for name in (ADDRESS, "localhost")]
        signed_with = secrets.token_bytes(32)
        inside = BokehTornado(
            {_PAGE: Application(FunctionHandler(hub.open))},
            extra_websocket_origins=hosts,
            sign_sessions=True,
            secret_key=signed_with,
            websocket_max_message_size_bytes=_MOST_MESSAGE_BYTES,
            check_unused_sessions_milliseconds=1000,
            unused_session_lifetime_milliseconds=_UNUSED_MS,
            include_headers=[],
            include_cookies=[],
        )
        inside.add_transform(_Headers)
        gate = _Gate(inside, hub, token, hosts, signed_with)
        http = HTTPServer(gate, max_header_size=1 << 14, max_body_size=1 << 10)
        http.add_sockets(sockets)
        self._bokeh = BaseServer(IOLoop.current(), inside, http)
        self._bokeh.start()
        self._watch = PeriodicCallback(self._look, _LOOK_EVERY_MS)
        self._watch.start()
        self.address = f"http://{ADDRESS}:{self.port}{_PAGE}?token={token}"

    def _look(self) -> None:
        """Tell the hub which browsers are there."""
        there = {str(one.id): one.connection_count for one in self._bokeh.get_sessions(_PAGE)}
        self._hub.note_connections(there)

    def stop(self) -> None:
        """End it, and all connections."""
        self._watch.stop()
        self._bokeh.stop(wait=False)
        self._bokeh.unlisten()
