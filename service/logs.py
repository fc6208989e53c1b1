"""Log lines: a time, an event name and its fields; no prose."""

import json
import logging
import sys

_PLAIN = frozenset(vars(logging.makeLogRecord({}))) | {"message", "asctime", "taskName"}


class FieldFormatter(logging.Formatter):
    """`2026-11-21T03:00:00 INFO event field=value`, exceptions below."""

    default_time_format = "%Y-%m-%dT%H:%M:%S"
    default_msec_format = "%s.%03d"

    def format(self, record: logging.LogRecord) -> str:
        """One line of a record."""
        fields = {name: value for name, value in vars(record).items() if name not in _PLAIN}
        extra = "".join(
            f" {name}={json.dumps(value, default=str)}" for name, value in fields.items()
        )
        line = f"{self.formatTime(record)} {record.levelname} {record.getMessage()}{extra}"
        return f"{line}\n{self.formatException(record.exc_info)}" if record.exc_info else line


def configure_logs() -> None:
    """Send our own events, and others' warnings, to stderr."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(FieldFormatter())
    logging.basicConfig(level=logging.WARNING, handlers=[handler], force=True)
    logging.getLogger("surefoot").setLevel(logging.INFO)
