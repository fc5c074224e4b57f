"""Prints the log of the program."""

import logging
import sys
from typing import TextIO

from hardware.printable import printable


class LogPrinter(logging.StreamHandler[TextIO]):
    """Prints the log to standard error.

    Args:
        form: Format of a line, as in `logging`. The default includes the time.
    """

    def __init__(self, form: str = "%(asctime)s %(levelname)-7s %(message)s") -> None:
        super().__init__(sys.stderr)
        self.setFormatter(logging.Formatter(form))

    def format(self, record: logging.LogRecord) -> str:
        """Return the lines of a record of the log."""
        return printable(super().format(record))
