"""`fleetloop`: signals, import path and streams before any heavy import, then the command line.

Until a verb takes signals itself, nothing is open that would have to be closed: a signal ends the
process at once and silently, wherever an import may be.
"""

import _signal  # type: ignore[import-not-found]  # `signal` takes imports of its own
import os

INTERRUPTED = 130
"""`configs.errors.ExitStatus.INTERRUPTED`, before anything is imported."""

for _number in (_signal.SIGINT, _signal.SIGTERM):
    if _signal.getsignal(_number) != _signal.SIG_IGN:
        _signal.signal(_number, lambda *_: os._exit(INTERRUPTED))


def main() -> None:
    """Run the command line."""
    from fleetloop import packages

    packages.prefer_own()
    from fleetloop import streams

    streams.settle()
    from fleetloop.cli import main as command_line

    command_line()


if __name__ == "__main__":
    main()
