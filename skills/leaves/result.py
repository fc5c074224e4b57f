"""Leaves with a fixed result: one always succeeds, the other always fails with a reason."""

from py_trees.common import Status

from skills.base import Skill
from skills.errors import TaskFailed
from skills.ports import Port


class Succeed(Skill):
    """Succeed at once."""

    may_fail = False
    synonyms = ("alwayssuccess",)

    def on_start(self) -> Status:
        """Succeed."""
        self.feedback_message = "done"
        return Status.SUCCESS


class Fail(Skill):
    """Fail with a reason."""

    may_succeed = False
    synonyms = ("alwaysfailure", "abort")

    INPUT_PORTS = {"reason": Port(str, description="message of the failure")}

    def on_start(self) -> Status:
        """Fail."""
        raise TaskFailed(self.get_input("reason"))
