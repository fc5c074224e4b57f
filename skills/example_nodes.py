"""Texts and names of skills for nodes of task files. Corrections and taught tasks use them."""

from collections.abc import Set

from py_trees.ports import get_ports_registry

from .leaves.blackboard import Compare
from .leaves.check_hardware import CheckHardware
from .leaves.result import Fail, Succeed
from .leaves.wait import Wait

EXAMPLE_CONDITION = CheckHardware.__name__
NODE_FOR = {True: Succeed.__name__, False: Fail.__name__}  # node that always succeeds, or fails


def wait_node(duration: str) -> str:
    """Return the text of a node that waits. The duration is a text such as `2 s`."""
    return f"{Wait.__name__}: {{duration: {duration}}}"


def compare_node(left: str, sign: str, right: str) -> str:
    """Return the text of a node that compares two values, in braces."""
    return f'{{{Compare.__name__}: {{left: {left}, is: "{sign}", right: {right}}}}}'


def condition_with(ports: Set[str]) -> str:
    """Return the name of a condition with exactly these input ports; empty if there is none."""
    kinds = get_ports_registry().items()
    found = (
        name
        for name, kind in kinds
        if getattr(kind, "condition", False) and kind.input_ports().keys() == ports
    )
    return next(found, "")
