"""Refusals by the router, counted from Zenoh's log, their only source.

    login        wrong password, unknown user, no login, a revoked certificate
    certificate  TLS that failed: expired, another authority's, none; a certificate of another
                 identity
    rights       puts and subscriptions without the right to them
    flood        a client that said too much, or `MOST_DENIED` times what it has no right to:
                 nothing more is taken from it, now and when it comes again
    unread       a client that read nothing while others waited to send to it: the router
                 disconnects it before all other clients stand still

Zenoh doesn't say whose certificate it refused, nor from where: an expired one is known by its last
second, one of another authority by nothing. A flooder is known by what it proved: its certificate's
name if it has one, else its user's name.

A login is a sequence of lines about one connection (TLS, InitSyn, OpenSyn); the last one has the
user's name. Zenoh looks up rights once when a key is declared, without a log line, and again for
each message, with one; messages dropped earlier by rate (`access.downsampling`) leave none. Memory
is bounded.
"""

import re
from collections import Counter
from collections.abc import Callable, Mapping
from typing import NamedTuple, TypeVar

from configs.tls import identity_and_number

_LOGINS = "zenoh_transport::unicast::establishment::accept=trace,zenoh_link_tls::unicast=debug"
_DEAFNESS = "zenoh_transport::unicast::universal::tx=error"
_RIGHTS = "zenoh::net::routing::interceptor::access_control"
MOST = 50
"""Texts of refusals that are told apart."""
MOST_DENIED = 1000
"""Denied messages of one connection that are taken before it is cut off."""
LOGIN, CERTIFICATE, RIGHTS, FLOOD, UNREAD = "login", "certificate", "rights", "flood", "unread"
_REMEMBERED = 4096
_LINE = re.compile(r"\S+Z +(?P<level>[A-Z]+) +(?P<thread>.*?ThreadId\(\d+\)) (?P<where>\S+): ")
_TLS = re.compile(r"Accepted TLS connection on \S+: (?P<peer>\S+)\. Common Name: (?P<name>.+)\.$")
_SYN = re.compile(r"Establishment Accept (?P<kind>Init|Open)Syn: \S+ => \w+/(?P<peer>\S+)\. Rec")
_ZID = re.compile(r" zid: (?P<zid>[0-9a-f]+),")
_LOGIN = re.compile(r"ext_auth: Some\(ZExtZBuf \{.*?slices: \[\[(?P<bytes>[0-9a-f, ]*)\]")
_WRONG = re.compile(r"UsrPwd extension - Recv \w+Syn\. (?P<why>Invalid \w+|Expected extension)")
_WHY = {
    "Invalid password": "wrong password",
    "Invalid user": "no identity of this run",
    "Expected extension": "no user and password given",
}
_HANDSHAKE = re.compile(r"(?P<why>.+?)\. Hint: increase the system open file limit")
_EXPIRED = re.compile(r"certificate expired: .* is not valid after (?P<at>\d{1,18})\b")
_VERIFIED_AT = re.compile(r": verification time \d+ .*")
_STRANGER = re.compile(r"(?P<zid>[0-9a-f]+) did not match any configured ACL subject")
_DEAF = re.compile(r"Unable to push non droppable network message to (?P<zid>[0-9a-f]+)\.")
_DENIED = re.compile(
    r"(?P<zid>[0-9a-f]+)(?P<at_first> on \S+)? is unauthorized to"
    r" (?P<what>Put|Delete|Declare Subscriber) \(ingress\) on (?P<key>.+)$"
)
_CACHING = re.compile(r"ACL \(ingress\): caching permissions for `(?P<key>.+)`")
_DOING = {"Put": "put on", "Delete": "delete of", "Declare Subscriber": "listening on"}
_USRPWD, _BUFFER = 0x2, 0x40
_Value = TypeVar("_Value")


def directives(*, every_message: bool) -> str:
    """What the log must say, for RUST_LOG; of denied puts it says 2 µs worth for every message."""
    return f"{_LOGINS},{_DEAFNESS},{_RIGHTS}={'trace' if every_message else 'info'}"


def is_ours(line: str) -> bool:
    """Whether a line is in the log for this module alone, whatever else RUST_LOG asks for."""
    found = _LINE.match(line)
    return (
        found is not None
        and found["level"] in ("TRACE", "DEBUG")
        and found["where"].endswith(("establishment::accept", "tls::unicast", "access_control"))
    )


class Refusal(NamedTuple):
    """One kind of refusal of one identity."""

    kind: str
    identity: str  # as it was claimed or proved; "" if it is unknown
    text: str


class Denials:
    """Counts them; one for each router.

    Args:
        certified: the common names that prove identities at present.
        kept_out: identities without rights, and why.
        expiries: identities of the authority's certificates, by their last second since 1970.
    """

    def __init__(
        self,
        certified: Mapping[str, str] | None = None,
        kept_out: Mapping[str, str] | None = None,
        expiries: Mapping[int, str] | None = None,
    ) -> None:
        self._certified = dict(certified or {})
        self._kept_out = dict(kept_out or {})
        self._expiries = dict(expiries or {})
        self._counts: Counter[Refusal] = Counter()
        self._denied: Counter[str] = Counter()  # messages, by peer
        self._new: list[str] = []
        self._names: dict[str, str] = {}  # common name of a certificate, by peer
        self._zids: dict[str, str] = {}  # by peer
        self._users: dict[str, tuple[str, str]] = {}  # user and peer, by Zenoh's identity
        self._latest = ("", "")  # user and peer of the login that is looked at
        self._deaf: dict[str, bool] = {}
        self.cut_off: set[str] = set()
        """Users one of whose sessions was cut off because it did not read."""
        self.flooders: set[str] = set()
        """What those proved whose session was cut off because it said too much."""
        self.turn_away: Callable[[str], None] = lambda _: None
        """Called, on the log's thread, with the address of a returning flooder."""
        self._caching: dict[str, str] = {}  # the key whose permissions a thread looks up in advance

    def process(self, line: str) -> None:
        """Read a line of the log."""
        found = _LINE.match(line)
        if found is None:
            return
        text = line[found.end() :]
        if "access_control" in found["where"]:
            self._on_denial(found["thread"], text)
        elif deaf := _DEAF.match(text):
            self._on_deaf(deaf["zid"])
        elif "tls" in found["where"]:
            if accepted := _TLS.match(text):
                _remember(self._names, accepted["peer"], accepted["name"])
            elif failed := _HANDSHAKE.match(text):
                self._on_handshake(failed["why"])
        elif syn := _SYN.match(text):
            self._on_syn(syn["kind"], syn["peer"], text)
        elif wrong := _WRONG.match(text):
            user, peer = self._latest
            self._users = {zid: at for zid, at in self._users.items() if at != (user, peer)}
            who = f"the login of {_shown(user)}" if user else "a login"
            why = self._why(user, peer) or _WHY[wrong["why"]]
            self._count(LOGIN, user, f"refused {who} from {_host(peer)}: {why}")

    def notes(self) -> list[str]:
        """All refusals so far, each with its count if it is more than one."""
        counts = list(self._counts.items())  # at once: the log's thread may add to them
        return [f"{it.text} ({count} times)" if count > 1 else it.text for it, count in counts]

    def counts(self) -> dict[str, dict[str, int]]:
        """How many refusals there were so far, by kind and identity."""
        found: dict[str, dict[str, int]] = {}
        for (kind, identity, _), count in list(self._counts.items()):
            of_kind = found.setdefault(kind, {})
            who = _plain(identity) or "unknown"
            of_kind[who] = of_kind.get(who, 0) + count
        return found

    def news(self) -> list[str]:
        """The kinds of refusals that are new since the last call."""
        news, self._new = self._new, []
        return news

    def peers(self, prefix: str) -> dict[str, str]:
        """Users whose names begin like this, by where they are."""
        known = list(self._users.values())
        return {peer: user for user, peer in known if user.startswith(prefix)}

    def note_flood(self, user: str, peer: str) -> None:
        """A user was cut off because it sent too much."""
        self.flooders.add(self._proof(user, peer))
        self._count(
            FLOOD,
            user,
            f"cut off {_shown(user)} from {_host(peer)}: it said far more than the schedule lets"
            " any controller say",
        )

    def logins_of(self, user: str) -> list[str]:
        """Refused logins as `user`."""
        return [note for note in self.notes() if f"the login of {_shown(user)} " in note]

    def _on_syn(self, kind: str, peer: str, text: str) -> None:
        if kind == "Init":
            self._latest = ("", peer)
            if zid := _ZID.search(text):
                _remember(self._zids, peer, zid["zid"])
            return
        login = _LOGIN.search(text)
        user = _user_of(bytes.fromhex(login["bytes"].replace(", ", ""))) if login else ""
        self._latest = (user, peer)
        if self._proof(user, peer) in self.flooders:
            self.turn_away(peer)
            text = f"turned away {_shown(user)} from {_host(peer)}: it was cut off before"
            self._count(FLOOD, user, text)
        if (zid_of_peer := self._zids.pop(peer, "")) and user:
            _remember(self._users, zid_of_peer, (user, peer))

    def _on_deaf(self, zid: str) -> None:
        """Said for every message that could not be sent, until the session has ended."""
        if zid not in self._deaf:
            _remember(self._deaf, zid, True)
            user, peer = self._users.get(zid, ("", ""))
            self.cut_off.add(user)
            self._count(
                UNREAD,
                user,
                f"cut off {_shown(user)} from {_host(peer)}: it did not read what it asked for, and"
                " all other clients would have waited for it",
            )

    def _on_denial(self, thread: str, text: str) -> None:
        if caching := _CACHING.match(text):
            _remember(self._caching, thread, caching["key"])
        elif stranger := _STRANGER.match(text):
            user, peer = self._users.get(stranger["zid"], ("", ""))
            name = self._names.get(peer)
            came = f"with the certificate of {_shown(name)}" if name else "without a right"
            self._count(
                CERTIFICATE if name else RIGHTS,
                identity_and_number(name)[0] if name else user,
                f"{_shown(user)} from {_host(peer)} came {came}: may neither say nor hear anything",
            )
        elif denied := _DENIED.search(text):
            if denied["at_first"] and self._caching.get(thread) == denied["key"]:
                return
            user, peer = self._users.get(denied["zid"], ("", ""))
            what = f"{_DOING[denied['what']]} {_plain(denied['key'])}"
            self._count(RIGHTS, user, f"denied to {_shown(user)} from {_host(peer)}: {what}")
            self._count_denied(user, peer)

    def _count_denied(self, user: str, peer: str) -> None:
        """Cut off a client that goes on with what it has no right to."""
        _remember(self._denied, peer, self._denied[peer] + 1)
        if self._denied[peer] == MOST_DENIED and user:
            self.flooders.add(self._proof(user, peer))
            self.turn_away(peer)
            text = f"cut off {_shown(user)} from {_host(peer)}: it went on with what it may not do"
            self._count(FLOOD, user, text)

    def _on_handshake(self, why: str) -> None:
        identity = ""
        if expired := _EXPIRED.search(why):
            identity = self._expiries.get(int(expired["at"]), "")
            whose = _shown(identity) if identity else "an unknown identity"
            why = f"the certificate of {whose} has expired"
        text = _VERIFIED_AT.sub("", why)
        self._count(CERTIFICATE, identity, f"refused a connection over TLS: {text}")

    def _why(self, user: str, peer: str) -> str:
        """Why an identity with a certificate was refused, "" if it is no such identity."""
        if user in self._kept_out:
            return self._kept_out[user]
        present, shown = self._certified.get(user), self._names.get(peer)
        if present is None or shown is None:
            return ""
        identity, number = identity_and_number(shown)
        if identity == user and number < identity_and_number(present)[1]:
            return f"its certificate is revoked: it is that of {_shown(shown)}"
        return f"it showed the certificate of {_shown(shown)}"

    def _proof(self, user: str, peer: str) -> str:
        return self._names.get(peer, user)

    def _count(self, kind: str, identity: str, text: str) -> None:
        refusal = Refusal(kind, identity, text)
        if refusal not in self._counts:
            if len(self._counts) >= MOST:
                refusal = Refusal(kind, "", "refused much else")
            if refusal not in self._counts:
                self._new.append(refusal.text)
        self._counts[refusal] += 1


def _remember(known: dict[str, _Value], key: str, value: _Value) -> None:
    if key not in known and len(known) >= _REMEMBERED:
        del known[next(iter(known))]
    known[key] = value


def _user_of(login: bytes) -> str:
    """The user's name in the extension of an OpenSyn: header, length, then length and name."""
    if len(login) < 2 or login[0] & 0x0F != _USRPWD or not login[0] & _BUFFER:
        return ""
    try:
        _, at = _number(login, 1)
        length, at = _number(login, at)
    except IndexError:
        return ""
    return login[at : at + length].decode("utf-8", "replace")


def _number(data: bytes, at: int) -> tuple[int, int]:
    """A number of 7 bits a byte, and where it ends."""
    value = shift = 0
    while data[at] & 0x80:
        value |= (data[at] & 0x7F) << shift
        at, shift = at + 1, shift + 7
    return value | data[at] << shift, at + 1


def _plain(text: str) -> str:
    """What a stranger chose, fit for a terminal."""
    shown = text if len(text) <= 120 else text[:117] + "..."
    return "".join(
        letter if letter.isprintable() else "\N{REPLACEMENT CHARACTER}" for letter in shown
    )


def _shown(name: str) -> str:
    return f"'{_plain(name)}'" if name else "an unknown user"


def _host(peer: str) -> str:
    return peer.rpartition(":")[0] or "somewhere"
