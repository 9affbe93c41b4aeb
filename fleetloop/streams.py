"""The standard streams in any state: closed, not in UTF-8, or without a reader.

A run outlives its terminal: what can't be said on standard error is lost, and nothing else. Results
that can't be written are an error, unless the reader closed the pipe (`| head`).
"""

import codecs
import contextlib
import io
import os
import sys
import unicodedata
from typing import IO, TextIO

from configs.errors import InfrastructureError

PLAIN = "fleetloop-plain"
"""Name of the codecs' error handler that writes what an encoding lacks in ASCII."""
_WORDS = {
    "×": "x", "·": ".", "−": "-", "≤": "<=", "≥": ">=", "≠": "!=", "→": "->", "←": "<-",
    "°": "deg", "±": "+/-", "√": "sqrt", "∞": "inf", "’": "'", "µ": "u", "ṡ": "s_dot",
    "│": "|", "└": "`",
}  # fmt: skip
_MARKS = {"\N{COMBINING CIRCUMFLEX ACCENT}": "_hat", "\N{COMBINING MACRON}": "_bar"}
_INPUT, _OUTPUT, _ERROR = range(3)


def settle() -> None:
    """Make the three streams safe to use; call before anything else opens a file."""
    register()
    for fd in (_INPUT, _OUTPUT, _ERROR):
        try:
            os.fstat(fd)
        except OSError:
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)  # the lowest number is free
    if sys.stdin is None:
        sys.stdin = open(_INPUT, encoding="utf-8", closefd=False)  # noqa: SIM115
    sys.stdout = _again(_Results, _without_log(sys.stdout), _OUTPUT)
    sys.stderr = _again(_Notes, sys.stderr, _ERROR)


def _without_log(stream: TextIO | None) -> TextIO | None:
    """Standard output where Zenoh's log is not: it writes to descriptor 1 if RUST_LOG is set."""
    if not os.environ.get("RUST_LOG") or not isinstance(stream, io.TextIOWrapper):
        return stream
    from bridge.process.lifecycle import reserve_stdout

    stream.flush()
    own = io.BufferedWriter(io.FileIO(reserve_stdout(), "w", closefd=False))
    return io.TextIOWrapper(own, stream.encoding, line_buffering=stream.line_buffering)


def register() -> None:
    """Make `PLAIN` known to the codecs."""
    codecs.register_error(PLAIN, _plain)


def is_utf8(stream: TextIO) -> bool:
    """Whether a stream takes any character as it is."""
    return (stream.encoding or "").lower().replace("-", "") == "utf8"


def spelled_for(stream: IO[str], text: str) -> str:
    """The text as the stream will show it, for layout in columns."""
    encoding = getattr(stream, "encoding", None) or "utf-8"
    errors = getattr(stream, "errors", None) or "replace"
    return text.encode(encoding, errors).decode(encoding)


def forget_output() -> None:
    """Drop the buffer of a closed pipe, so that it raises nothing when the interpreter ends."""
    with contextlib.suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)


class _Results(io.TextIOWrapper):
    """Standard output: `BrokenPipeError` on a closed pipe, else an error that names the cause."""

    def write(self, text: str, /) -> int:
        """Write as any stream does."""
        try:
            return super().write(text)
        except OSError as error:
            raise _failure(error) from error

    def flush(self) -> None:
        """Flush as any stream does."""
        try:
            super().flush()
        except OSError as error:
            raise _failure(error) from error


class _Notes(io.TextIOWrapper):
    """Standard error: what can't be written is lost."""

    def write(self, text: str, /) -> int:
        """Write if it can be."""
        with contextlib.suppress(OSError):
            super().write(text)
        return len(text)

    def flush(self) -> None:
        """Flush if it can be."""
        with contextlib.suppress(OSError):
            super().flush()


def _failure(error: OSError) -> Exception:
    if isinstance(error, BrokenPipeError):
        return error
    forget_output()
    return InfrastructureError(f"can't write the results to standard output: {error.strerror}")


def _again(kind: type[io.TextIOWrapper], stream: TextIO | None, fd: int) -> io.TextIOWrapper:
    """The same stream as one of our kinds; on `fd` if there is none."""
    if not isinstance(stream, io.TextIOWrapper):
        return kind(io.FileIO(fd, "w", closefd=False), "utf-8", PLAIN, write_through=True)
    encoding, buffered = stream.encoding, stream.line_buffering
    return kind(stream.detach(), encoding, PLAIN, line_buffering=buffered)


def _plain(error: UnicodeError) -> tuple[str, int]:
    """Write characters that an encoding lacks in ASCII, as people would."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return "".join(map(_spelled, error.object[error.start : error.end])), error.end


def _spelled(character: str) -> str:
    if character in _WORDS:
        return _WORDS[character]
    if unicodedata.combining(character):
        return _MARKS.get(character, "")
    name = unicodedata.name(character, "")
    if name.startswith("GREEK "):
        letter = name.split()[3] if len(name.split()) > 3 else "?"
        return letter.title() if "CAPITAL" in name else letter.lower()
    kind, _, digits = unicodedata.decomposition(character).rpartition("> ")
    if kind == "<super":
        return f"^{chr(int(digits, 16))}"
    decomposed = unicodedata.normalize("NFKD", character)
    return decomposed.encode("ascii", "ignore").decode() or "?"
