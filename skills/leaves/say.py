"""A leaf that writes a line to the log."""

import logging

from py_trees.common import Status

from skills.base import Skill
from skills.ports import Port

logger = logging.getLogger(__name__)


class Say(Skill):
    """Print a text and a value to the log and the recording."""

    may_fail = False
    synonyms = ("print", "log", "debug", "echo")

    INPUT_PORTS = {
        "text": Port(str, description="text to print"),
        "value": Port(object, description="value to print after the text", default_value=""),
    }

    def on_start(self) -> Status:
        """Print the text."""
        value = self.get_input("value")
        shown = f"{value:g}" if isinstance(value, float) else str(value)
        line = f"{self.get_input('text')} {shown}".rstrip()
        logger.info("%s", line)
        self.feedback_message = line
        return Status.SUCCESS
