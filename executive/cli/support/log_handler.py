"""Records the log of the program."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager

import logs
from executive.executive import Executive


@contextmanager
def recorded_log(executive: Executive) -> Iterator[None]:
    """Record every line of the log during this context."""
    handler = LogHandler(executive)
    logging.getLogger().addHandler(handler)
    try:
        yield
    finally:
        logging.getLogger().removeHandler(handler)


class LogHandler(logging.Handler):
    """Gives each line of the log to an executive, as a record.

    Args:
        executive: Executive that receives the records.
    """

    def __init__(self, executive: Executive) -> None:
        super().__init__(logging.INFO)
        self._executive = executive

    def emit(self, record: logging.LogRecord) -> None:
        """Record a line."""
        now, text = self._executive.clock.now(), record.getMessage()
        self._executive.record(logs.LogLine(now, record.levelno, record.name, text))
