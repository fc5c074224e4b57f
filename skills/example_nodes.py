"""Nodes of shipped skills in the form of task files, for corrections and taught tasks."""

from .leaves.blackboard import Compare
from .leaves.check_hardware import CheckHardware
from .leaves.result import Fail, Succeed
from .leaves.wait import Wait

EXAMPLE_CONDITION = CheckHardware.__name__
NODE_FOR = {True: Succeed.__name__, False: Fail.__name__}  # nodes with a fixed result


def wait_node(duration: str) -> str:
    """Return a node that waits, for a duration such as `2 s`."""
    return f"{Wait.__name__}: {{duration: {duration}}}"


def compare_node(left: str, sign: str, right: str) -> str:
    """Return a node that compares two values, in braces."""
    return f'{{{Compare.__name__}: {{left: {left}, is: "{sign}", right: {right}}}}}'
