"""Causes of a failed login or listen, from the text of Zenoh's errors.

Zenoh says it of a peer only; of a client it says that it could not connect. So who was refused as a
client asks again as a peer, for the reason (`bridge.network.zenoh_link`).
"""

import re
from typing import NamedTuple


class Obstacle(NamedTuple):
    """What is in the way; `final`: it will not go away by itself."""

    text: str
    final: bool


_REFUSED = "it refused the login: not the password of {user!r}, or no identity of its run"
_OBSTACLES = (
    (r"close message \(reason (?:GENERIC|0)\)", _REFUSED, True),
    (r"close message \(reason ([\w ]+)\)", "it refused the session ({0})", False),
    (r"fatal alert: CertificateRequired", "it refused the login: no certificate was shown", True),
    (
        r"fatal alert: (?:UnknownCA|DecryptError)",
        "it refused the certificate of {user!r}: signed by none of its authority",
        True,
    ),
    (r"fatal alert: (\w+)", "it refused the certificate of {user!r}: {0}", True),
    (
        r"invalid peer certificate: (?:UnknownIssuer|BadSignature)",
        "its certificate is not signed by the authority in ca, so it was refused here",
        True,
    ),
    (r"invalid peer certificate: (.+?)(?: at /|$)", "its certificate was refused here: {0}", True),
    (r"Connection refused", "nobody listens there (Connection refused)", False),
    (
        r"(Name or service not known|No address associated|Temporary failure in name resolution)",
        "no such host ({0})",
        False,
    ),
    (r"((?:Network|No route|Host) (?:is )?(?:to host|unreachable|is down))", "{0}", False),
    (
        r"early eof|Connection reset|Broken pipe",
        "somebody listens there, and closed the connection: overloaded, another program, or tcp/"
        " instead of tls/",
        False,
    ),
    (r"InvalidContentType|corrupt message", "it speaks no TLS there: tls/ instead of tcp/", True),
    (r"deadline has elapsed", "no answer from there", False),
)
_TAKEN = (
    (r"\[(\S+:\d+): Address already in use", "{0} is already in use"),
    (r"\[(\S+:\d+): Cannot assign requested address", "{0} is no address of this machine"),
    (r"\[(\S+:\d+): Permission denied", "{0} is not for this user: ports below 1024 are root's"),
    (r"(Name or service not known|No address associated)", "no such host ({0})"),
    (r"Missing TLS", "tls/ needs certificates: network.tls of a deployment"),
)


def obstacle(said: str, user: str) -> Obstacle:
    """What Zenoh's error means for who wants to log in as `user`."""
    for pattern, text, final in _OBSTACLES:
        if found := re.search(pattern, said):
            return Obstacle(text.format(*found.groups(), user=user), final)
    return Obstacle(_plain(said) or "no answer from there", final=False)


def taken(said: str) -> str:
    """What Zenoh's error means for who wants to listen."""
    for pattern, text in _TAKEN:
        if found := re.search(pattern, said):
            return text.format(*found.groups())
    return _plain(said) or "Zenoh doesn't answer"


def _plain(said: str) -> str:
    """Without places in Zenoh's own source."""
    return re.sub(r" at /\S+:\d+\.", "", said)
