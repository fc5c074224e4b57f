"""Saying something, to whoever watches and to the recording."""

import logging

from py_trees.common import Status
from py_trees.ports import PortInformation

from skills.base import Skill
from skills.errors import TaskFailed
from skills.ports import Port

logger = logging.getLogger(__name__)


class Say(Skill):
    """Say a text, and the value of a key after it."""

    may_fail = False

    INPUT_PORTS = {
        "text": Port(str, description="what to say"),
        "value": Port(object, description="said after the text", default_value=""),
    }
    OUTPUT_PORTS: dict[str, PortInformation] = {}

    def on_start(self) -> Status:
        """Say it."""
        said = f"{self.get_input('text')} {_shown(self.get_input('value'))}".rstrip()
        logger.info("%s", said)
        self.feedback_message = said
        return Status.SUCCESS


class Fail(Skill):
    """End in failure, and say why."""

    may_succeed = False

    INPUT_PORTS = {"reason": Port(str, description="why")}
    OUTPUT_PORTS: dict[str, PortInformation] = {}

    def on_start(self) -> Status:
        """Fail."""
        raise TaskFailed(self.get_input("reason"))


def _shown(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
