"""The log of the program, as records."""

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import logs
from executive.executive import Executive
from hardware import Clock


@contextmanager
def recorded_log(executive: Executive) -> Iterator[None]:
    """Record every line of the log."""
    handler = LogHandler(executive.record, executive.clock)
    logging.getLogger().addHandler(handler)
    try:
        yield
    finally:
        logging.getLogger().removeHandler(handler)


class LogHandler(logging.Handler):
    """Passes lines of the log on as records.

    Args:
        record: Receives the records.
        clock: Time source.
    """

    def __init__(self, record: Callable[[logs.Record], None], clock: Clock) -> None:
        super().__init__(logging.INFO)
        self._record, self._clock = record, clock

    def emit(self, record: logging.LogRecord) -> None:
        """Pass a line on."""
        text = record.getMessage()
        self._record(logs.LogLine(self._clock.now(), record.levelno, record.name, text))
