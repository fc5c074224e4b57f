"""Lines of the program's log, as records."""

import logging
from collections.abc import Callable

import logs
from hardware import Clock


class LogHandler(logging.Handler):
    """Hands log lines to whoever records.

    Args:
        tell: Where they go.
        clock: Whose time.
    """

    def __init__(self, tell: Callable[[logs.Record], None], clock: Clock) -> None:
        super().__init__(logging.INFO)
        self._tell, self._clock = tell, clock

    def emit(self, record: logging.LogRecord) -> None:
        """Hand a line on."""
        text = record.getMessage()
        self._tell(logs.LogLine(self._clock.now(), record.levelno, record.name, text))
