"""A clock that tests set."""


class ManualClock:
    """Stands still until somebody waits on it or `passes` is called; reading it may take time."""

    def __init__(self, now_ns: int = 0, *, reading_ns: int = 0) -> None:
        self.now_ns = now_ns
        self._reading_ns = reading_ns

    def monotonic_ns(self) -> int:
        self.now_ns += self._reading_ns
        return self.now_ns

    def monotonic_s(self) -> float:
        return self.now_ns * 1e-9

    def wall_ns(self) -> int:
        return self.now_ns

    def sleep(self, seconds: float) -> None:
        self.passes(seconds)

    def passes(self, seconds: float) -> None:
        self.now_ns += round(seconds * 1e9)
