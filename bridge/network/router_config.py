"""Configuration of a run's router: who may log in, who may say what, how much and how often. Pure.

The launcher opens its own router with it; a stock `zenohd` of the same version takes it as a file
(`fleetloop network --router-config`).
"""

import json
import resource
from collections.abc import Mapping, Sequence
from pathlib import Path

from bridge.network.access import AccessPlan
from bridge.network.session import WAIT_BEFORE_CLOSE, common, mutual_tls
from configs.tls import TlsFiles

HANDSHAKE_S = 2.0
MOST_PENDING = 4096
_LEAST_PENDING, _LEAST_SESSIONS = 100, 1000


def router_settings(
    access: AccessPlan,
    listen: Sequence[str],
    dictionary: Path,
    tls: TlsFiles | None,
    *,
    lease_s: float,
    unread_s: float,
) -> dict[str, object]:
    """Settings of a router by path in Zenoh's configuration.

    `dictionary` is the file of users and passwords (`AccessPlan.dictionary`). A client that doesn't
    read is cut off after `unread_s`; one that hears nothing for `lease_s` takes the router for
    gone.
    """
    certified = {} if tls is None else {"transport/link/tls": mutual_tls(tls, "listen")}
    return {
        **common("router", lease_s),
        "listen/endpoints": [_hasty(endpoint) for endpoint in listen],
        **certified,
        **_pending(len(access.rights)),
        "transport/auth/usrpwd/dictionary_file": str(dictionary),
        "access_control": access.access_control(),
        "low_pass_filter": access.low_pass_filter(),
        "downsampling": access.downsampling(),
        WAIT_BEFORE_CLOSE: int(unread_s * 1e6),
    }


def document(settings: Mapping[str, object], title: str) -> str:
    """The settings as a file in JSON5, under a comment."""
    tree: dict[str, object] = {}
    for path, value in settings.items():
        *above, last = path.split("/")
        place = tree
        for name in above:
            inner = place.setdefault(name, {})
            if not isinstance(inner, dict):
                raise TypeError(path)
            place = inner
        place[last] = value
    return f"// {title}\n{json.dumps(tree, indent=2)}\n"


def _hasty(endpoint: str) -> str:
    """The same with a bound on how long a handshake of TLS may take."""
    milliseconds = int(HANDSHAKE_S * 1e3)
    return f"{endpoint}#tls_handshake_timeout_ms={milliseconds}" if "tls/" in endpoint else endpoint


def _pending(identities: int) -> dict[str, object]:
    """Bound connections without a login, so that they keep no other client out.

    Each costs a descriptor until `HANDSHAKE_S`; further connections are closed, and honest clients
    retry at once. They get a quarter of the descriptors at most.
    """
    descriptors, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    pending = min(max(descriptors // 4, 2 * identities, _LEAST_PENDING), MOST_PENDING)
    return {
        "transport/unicast/accept_timeout": int(HANDSHAKE_S * 1e3),
        "transport/unicast/accept_pending": pending,
        "transport/unicast/max_sessions": _LEAST_SESSIONS + 2 * identities,
    }
