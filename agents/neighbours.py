"""The newest path states of the in-neighbours, and their sums for the coordination.

Path states carry their time. Three compensations of their age, `coordination.compensation`:

    extrapolate   s_j ← s_j + v̂_j (age + h/2)         the value in the middle of the coming period
    hold          s_j ← s_j                           biased by v_r per second of age and hop
    both          s_j ← s_j + s_i − s_i(t − age)      own value as old as the neighbour's: no bias,
                                                      but a finite margin of delay

with an age of at most `age_limit_s`. v̂_j is held as received, which
makes (38) an average at every share: robot i's next v̂ is a convex combination of its own, of the
received ones and of v_r, with fixed positive weights. So where the leader reaches every robot,
v̂ → v_r at any share period, with any delay, on any graph, also on one that changes. Extrapolated by
its slope, v̂_j would diverge on graphs with cycles and slow shares.

Each counts with its weight a_ij. A neighbour silent for longer than `silence_limit_s`, or whose
edge is gone, leaves the sums until its next path state. Sums run in the order of names, so they
don't depend on the order of arrival.
"""

from collections import deque
from collections.abc import Collection, Iterable
from math import nan

from configs.edges import InEdge
from configs.sections import Coordination


def extrapolated(s: float, v_hat: float, age_s: float, half_s: float) -> float:
    """s_j in the middle of the coming period, of half length h/2, by what was said an age ago."""
    return s + v_hat * (age_s + half_s)


class Sums:
    """d = Σ a_ij, Σ a_ij s_j, Σ a_ij v̂_j over the neighbours that are not silent."""

    __slots__ = ("degree", "neighbours", "s", "v")

    def __init__(self, neighbours: int, degree: float, s: float, v: float) -> None:
        self.neighbours = neighbours  # these
        self.degree = degree
        self.s = s
        self.v = v


class _Neighbour:
    __slots__ = ("exists", "heard", "s", "t_ns", "v_hat", "weight")

    def __init__(self, weight: float) -> None:
        self.weight = weight
        self.exists = True  # the edge
        self.t_ns = 0
        self.s = self.v_hat = 0.0
        self.heard = False


class Neighbours:
    """The in-neighbours of one robot."""

    __slots__ = (
        "_age_limit_s",
        "_by_name",
        "_extrapolates",
        "_half_s",
        "_in_order",
        "_own_past",
        "_period_s",
        "_silence_limit_s",
    )

    def __init__(self, edges: Iterable[InEdge], limits: Coordination, period_s: float) -> None:
        weights = {edge.speaker: edge.weight for edge in edges}
        self._by_name = {name: _Neighbour(weights[name]) for name in sorted(weights)}
        self._in_order = tuple(self._by_name.values())
        self._half_s = 0.5 * period_s
        self._age_limit_s = limits.age_limit_s
        self._silence_limit_s = limits.silence_limit_s
        self._extrapolates = limits.compensation == "extrapolate"
        self._period_s = period_s
        self._own_past: deque[float] | None = None  # s_i of this and former periods, newest last
        if limits.compensation == "both":
            oldest_s = min(limits.age_limit_s, limits.silence_limit_s)
            self._own_past = deque(maxlen=round(oldest_s / period_s) + 1)

    def receive(self, name: str, t_ns: int, s: float, v_hat: float) -> None:
        """Store the path state of `name` at time `t_ns`.

        It is ignored if it isn't newer, or if the edge doesn't exist.
        """
        neighbour = self._by_name[name]
        if not neighbour.exists:
            return
        if neighbour.heard and t_ns <= neighbour.t_ns:
            return
        neighbour.t_ns = t_ns
        neighbour.s = s
        neighbour.v_hat = v_hat
        neighbour.heard = True

    def follow(self, names: Collection[str]) -> None:
        """Let these be the edges that exist; a neighbour over a new one counts once it is heard."""
        for name, neighbour in self._by_name.items():
            if neighbour.exists and name not in names:
                neighbour.heard = False
            neighbour.exists = name in names

    def sums(self, now_ns: int, own_s: float) -> Sums:
        """The sums for the period that begins at `now_ns`, at the robot's own s [m]."""
        count = 0
        degree = sum_s = sum_v = 0.0
        half = self._half_s
        extrapolates, past = self._extrapolates, self._own_past
        if past is not None:
            past.append(own_s)
        for neighbour in self._in_order:
            age = (now_ns - neighbour.t_ns) * 1e-9
            if not neighbour.heard or age > self._silence_limit_s:
                continue
            if age > self._age_limit_s:
                age = self._age_limit_s
            weight = neighbour.weight
            count += 1
            degree += weight
            if extrapolates:
                sum_s += weight * extrapolated(neighbour.s, neighbour.v_hat, age, half)
            elif past is None:
                sum_s += weight * neighbour.s
            else:
                ago = min(round(age / self._period_s), len(past) - 1)
                sum_s += weight * (neighbour.s + (own_s - past[-1 - ago]))
            sum_v += weight * neighbour.v_hat
        return Sums(count, degree, sum_s, sum_v)

    def carried_on(self, at_ns: int) -> tuple[float, float, float]:
        """Σ a_ij, Σ a_ij s_j, Σ a_ij v̂_j with s_j carried on to an instant, as to extrapolate."""
        degree = sum_s = sum_v = 0.0
        for neighbour in self._in_order:
            age = (at_ns - neighbour.t_ns) * 1e-9
            if neighbour.heard and age <= self._silence_limit_s:
                weight = neighbour.weight
                degree += weight
                sum_s += weight * (neighbour.s + neighbour.v_hat * min(age, self._age_limit_s))
                sum_v += weight * neighbour.v_hat
        return degree, sum_s, sum_v

    def heard(self, now_ns: int) -> list[tuple[str, float]]:
        """The neighbours whose edges exist, and ages as `ages_s` gives them."""
        ages_s = zip(self._by_name.items(), self.ages_s(now_ns), strict=True)
        return [(name, age_s) for (name, one), age_s in ages_s if one.exists]

    def ages_s(self, now_ns: int) -> list[float]:
        """Age of the newest path state of each neighbour [s], in the order of names.

        NaN: none has been received.
        """
        return [(now_ns - one.t_ns) * 1e-9 if one.heard else nan for one in self._in_order]
