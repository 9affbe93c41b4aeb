"""Client sessions: how a process connects to the router of its run.

A refused login is reported at once; a router that isn't there yet is waited for. Zenoh names the
reason of a refusal to peers only, so a refused client asks again as a peer. Attempts take Zenoh's
time, so their bound is kept by the system's clock: another one would change nothing.
"""

from itertools import cycle

import zenoh

from bridge.network.session import (
    ONE_THREAD,
    WAIT_BEFORE_CLOSE,
    common,
    config_of,
    few_threads,
    mutual_tls,
    open_bounded,
    set_key,
)
from bridge.network.session_errors import Obstacle, obstacle
from bridge.network.zenoh_link import POLLED_DEPTH, PolledLink, ZenohLink
from bridge.process.clock import SYSTEM_CLOCK
from bridge.process.lifecycle import Stop
from bridge.process.waiting import readable
from configs.connections import NetworkLink
from configs.errors import InfrastructureError

_PROBE_S = 1.0
_FIRST_RETRY_S, _LAST_RETRY_S = 0.02, 0.3
_ATTEMPTS_S = (2.0, 5.0)
"""Bounds of attempts, in turn. A session that has lost its router keeps the one that opened it: the
shorter, but for networks whose handshakes take longer. Within an attempt the kernel asks again
after 1 s, then after 2 s or more before Linux 6.5; a new attempt asks at once."""
_AGAIN = {"period_init_ms": 100, "period_max_ms": 200, "period_increase_factor": 2.0}
"""Between two attempts of a session that has lost its router."""
_BLOCKED_S = 5.0
"""Zenoh's default: a put that blocks longer closes its session."""


class StoppedError(Exception):
    """Asked to stop before there was a session."""


def open_client(network: NetworkLink, timeout_s: float, stop: Stop | None = None) -> ZenohLink:
    """Connect to the router as `network.user`.

    Raises:
        InfrastructureError: no answer from there, or the login was refused.
        StoppedError: `stop` was requested before.
    """
    return ZenohLink(open_session(network, timeout_s, stop))


def open_polled(
    network: NetworkLink,
    timeout_s: float,
    stop: Stop | None = None,
    *,
    depth: int = POLLED_DEPTH,
) -> PolledLink:
    """Connect with a polled link that keeps the newest `depth` messages on each key."""
    return PolledLink(open_session(network, timeout_s, stop), depth)


def open_session(network: NetworkLink, timeout_s: float, stop: Stop | None) -> zenoh.Session:
    """A session of its own; a refused login ends the attempts, an absent router does not.

    Raises:
        InfrastructureError: no answer from there, or the login was refused.
        StoppedError: `stop` was requested before.
    """
    wake = [] if stop is None else [stop.wake_fd]
    deadline = SYSTEM_CLOCK.monotonic_s() + timeout_s
    pause_s = _FIRST_RETRY_S
    attempts_s = cycle(_ATTEMPTS_S)
    while True:
        left_s = min(max(deadline - SYSTEM_CLOCK.monotonic_s(), _FIRST_RETRY_S), next(attempts_s))
        with few_threads(ONE_THREAD):
            session = open_bounded(_login_config("client", network, left_s), left_s + 1.0)
        if not isinstance(session, str):
            return session
        reason = _reason(network)
        if reason.final or SYSTEM_CLOCK.monotonic_s() + pause_s > deadline:
            within = "" if reason.final else f" within {timeout_s:g} s"
            raise InfrastructureError(
                f"{network.user}: no session with the router at {network.endpoint}{within}:"
                f" {reason.text}"
            )
        if readable(wake, pause_s):
            raise StoppedError
        pause_s = min(1.5 * pause_s, _LAST_RETRY_S)


def _reason(network: NetworkLink) -> Obstacle:
    """Why there is no session: Zenoh tells it peers only."""
    config = _login_config("peer", network, _PROBE_S)
    set_key(config, "listen/endpoints", [])
    set_key(config, "connect/exit_on_failure", True)
    said = open_bounded(config, _PROBE_S + 1.0)
    if isinstance(said, str):
        return obstacle(said, network.user)
    said.close()
    return obstacle("", network.user)


def _login_config(mode: str, network: NetworkLink, timeout_s: float) -> zenoh.Config:
    """For a single attempt."""
    config = config_of(common(mode, network.lease_s))
    # A put that finds the router stopped waits for as long as the router may.
    set_key(config, WAIT_BEFORE_CLOSE, int(max(network.lease_s, _BLOCKED_S) * 1e6))
    set_key(config, "connect/endpoints", [network.endpoint])
    set_key(config, "connect/timeout_ms", 0)
    set_key(config, "connect/retry", _AGAIN)
    set_key(config, "transport/unicast/open_timeout", max(int(timeout_s * 1000), 1))
    set_key(config, "transport/auth/usrpwd/user", network.user)
    set_key(config, "transport/auth/usrpwd/password", network.password)
    if network.tls is not None:
        set_key(config, "transport/link/tls", mutual_tls(network.tls, "connect"))
    return config
