"""Causes of a failed login or listen, from the text of Zenoh's errors.

Zenoh names the cause to peers only, so a refused client asks again as a peer (`client`).
"""

import re
from typing import NamedTuple


class Obstacle(NamedTuple):
    """Cause of a failure; `final`: retrying can't help."""

    text: str
    final: bool


_REFUSED = (
    "it refused the login: not the password or present certificate of {user!r}, or no identity of"
    " its run"
)
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
    (r"Connection refused", "no program listens there (Connection refused)", False),
    (
        r"(Name or service not known|No address associated|Temporary failure in name resolution)",
        "no such host ({0})",
        False,
    ),
    (r"((?:Network|No route|Host) (?:is )?(?:to host|unreachable|is down))", "{0}", False),
    (
        r"early eof|Connection reset|Broken pipe",
        "the program there closed the connection: overloaded, another program, or tcp/"
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
    (r"Missing TLS", "tls/ needs certificates: network.certificates of a deployment"),
)


def obstacle(said: str, user: str) -> Obstacle:
    """Cause of a failed login as `user`, from Zenoh's error."""
    for pattern, text, final in _OBSTACLES:
        if found := re.search(pattern, said):
            return Obstacle(text.format(*found.groups(), user=user), final)
    return Obstacle(_plain(said) or "no answer from there", final=False)


def taken(said: str) -> str:
    """Cause of a failed listen, from Zenoh's error."""
    for pattern, text in _TAKEN:
        if found := re.search(pattern, said):
            return text.format(*found.groups())
    return _plain(said) or "Zenoh doesn't answer"


def _plain(said: str) -> str:
    """Without places in Zenoh's own source."""
    return re.sub(r" at /\S+:\d+\.", "", said)
