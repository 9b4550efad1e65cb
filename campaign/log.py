"""Messages on stderr: one line each, as text or as JSON."""

from __future__ import annotations

import logging
import sys
from datetime import UTC, datetime

from ..models.names import printable
from .files.names import json_text

FORMATS = ("text", "json")
logger = logging.getLogger("echoset")
_LEVELS = {-1: logging.ERROR, 0: logging.WARNING, 1: logging.INFO, 2: logging.DEBUG}


def _time(record: logging.LogRecord, precision: str) -> str:
    """ISO 8601 in UTC."""
    return datetime.fromtimestamp(record.created, UTC).isoformat(timespec=precision)


class _Text(logging.Formatter):
    """``echoset: error: ...``; below a warning without the level, off a terminal with the time."""

    def format(self, record: logging.LogRecord) -> str:
        level = f"{record.levelname.lower()}: " if record.levelno >= logging.WARNING else ""
        time = "" if sys.stderr.isatty() else _time(record, "seconds").replace("+00:00", "Z ")
        return f"{time}echoset: {level}{_one_line(record)}" + self._traceback(record)

    def _traceback(self, record: logging.LogRecord) -> str:
        if not record.exc_info:
            return ""
        lines = self.formatException(record.exc_info).splitlines()
        return "".join(f"\n{printable(line)}" for line in lines)


class _Json(logging.Formatter):
    """An object with time, level, message and, where there is one, traceback."""

    def format(self, record: logging.LogRecord) -> str:
        entry = {
            "time": _time(record, "milliseconds"),
            "level": record.levelname.lower(),
            "message": _one_line(record),
        }
        if record.exc_info:
            entry["traceback"] = self.formatException(record.exc_info)
        return json_text(entry)


class _Stderr(logging.Handler):
    """Writes to what stderr is now, above any progress bar."""

    def emit(self, record: logging.LogRecord) -> None:
        try:
            if "tqdm" in sys.modules:
                sys.modules["tqdm"].tqdm.write(self.format(record), file=sys.stderr)
            else:
                print(self.format(record), file=sys.stderr)
        except OSError:
            pass


def _one_line(record: logging.LogRecord) -> str:
    return printable(" ".join(record.getMessage().split()))


_settings: tuple[int, str] = (0, "text")


def configure(verbosity: int = 0, form: str = "text") -> None:
    """Say errors only (-1), warnings (0), progress (1) or everything, tracebacks too (2)."""
    global _settings
    _settings = verbosity, form
    handler = _Stderr()
    handler.setFormatter(_Json() if form == "json" else _Text())
    logging.captureWarnings(True)
    for name in (logger.name, "py.warnings"):
        target = logging.getLogger(name)
        target.handlers, target.propagate = [handler], False
        target.setLevel(_LEVELS[max(-1, min(2, verbosity))])


def error(text: str, cause: BaseException | None = None) -> None:
    """Say an error, with its traceback where everything is wanted."""
    logger.error("%s", text, exc_info=cause if logger.isEnabledFor(logging.DEBUG) else None)


def settings() -> tuple[int, str]:
    """The last arguments of :func:`configure`, for another process."""
    return _settings


def is_quiet() -> bool:
    """Whether only errors are wanted."""
    return not logger.isEnabledFor(logging.WARNING)
