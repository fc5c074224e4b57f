"""Sequence and selector: children that run one after the other."""

from collections.abc import Iterator
from typing import ClassVar

from py_trees import composites
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from skills import Context
from trees.declarations import Declaration

from .kind import ControlNodeKind, Element, Flow, Node, Options, PossibleOutcomes, all_of, any_of

# Period of the checks of the earlier children of a node without memory [s].
RECHECK_PERIOD = 0.1

_MEMORY = {
    "memory": Declaration(
        "boolean",
        default=True,
        description="false: repeat finished children while a later one runs",
    )
}


_IF = "there is no if: a selector runs its nodes until one succeeds; begin the "
_IF += "selector with the "
_UNTIL = "a selector runs its nodes until one succeeds; begin each node with a `-`"
_TRY, _ON_FAILURE = (f"there is no {word}: {_UNTIL}" for word in ("try", "on_failure"))
_ONE_CASE = f"{_IF}inverted condition"
_SWITCH = "there is no switch: a selector runs its nodes until one succeeds; write a sequence for "
_SWITCH += "each case, with its condition as the first node"
_TWO_CASES = f"{_IF}sequence of one case, which begins with the condition"


class _Reactive:
    """Mixin for nodes without memory. While a child runs, they check the children before it."""

    status: Status

    def __init__(self, name: str, children: list[Behaviour], context: Context) -> None:
        super().__init__(name, memory=False, children=children)  # type: ignore[call-arg]
        self._context = context

    def tick(self) -> Iterator[Behaviour]:
        """Tick the children, beginning with the first child."""
        yield from super().tick()  # type: ignore[misc]
        if self.status is Status.RUNNING:
            self._context.wake_at(self._context.now() + RECHECK_PERIOD)


class ReactiveSequence(_Reactive, composites.Sequence):
    """A sequence without memory: while a child runs, it repeats the earlier children."""


class ReactiveSelector(_Reactive, composites.Selector):
    """A selector without memory: while a child runs, it repeats the earlier children."""


class _SequentialKind(ControlNodeKind, register=False):
    """A kind of node that runs its children one after the other, with or without memory.

    Attributes:
        with_memory: Class of a node with memory.
        reactive: Class of a node without memory.
    """

    options = _MEMORY
    many = True
    with_memory: ClassVar[type[composites.Sequence | composites.Selector]]
    reactive: ClassVar[type[ReactiveSequence | ReactiveSelector]]

    def make(
        self, name: str, children: list[Behaviour], options: Options, context: Context
    ) -> Behaviour:
        """Return a new node."""
        if options["memory"]:
            return self.with_memory(name, memory=True, children=children)
        return self.reactive(name, children, context)

    def label(self, options: Options) -> str:
        """Return the name of the node in drawings."""
        return self.name if options["memory"] else f"reactive {self.name}"

    def groot(self, options: Options) -> list[Element]:
        """Return the node of BehaviorTree.CPP."""
        return [(self.groot_tag if options["memory"] else f"Reactive{self.groot_tag}", {})]

    def check(self, node: Node) -> None:
        """Report actions before the last child of a node without memory."""
        for child in [] if node.options["memory"] else node.below()[:-1]:
            if name := child.action():
                child.wrong(
                    f"{name} acts; without memory it would be restarted while a later node runs. "
                    "Put only conditions before the last node"
                )


class SequenceKind(_SequentialKind):
    """Runs its children one after the other, until one fails."""

    name = "sequence"
    synonyms = ("steps", "actions", "and", "ReactiveSequence", "SequenceWithMemory")
    with_memory, reactive = composites.Sequence, ReactiveSequence
    groot_tag = "Sequence"

    def possible_outcomes(self, node: Node) -> PossibleOutcomes:
        """Return the possible outcomes, and report children that are never reached."""
        children = node.children(node.halted)
        node.check_reached([each.succeeds for each in children], "succeeds")
        return all_of(children, sum(each.shortest for each in children))


class SelectorKind(_SequentialKind):
    """Runs its children one after the other, until one succeeds."""

    name = "selector"
    order = Flow.ALTERNATIVES
    with_memory, reactive = composites.Selector, ReactiveSelector
    groot_tag = "Fallback"
    synonyms = ("fallback", "or", "Fallback", "ReactiveFallback")
    keywords = {
        "else": _TWO_CASES,
        "if": _ONE_CASE,
        "on_failure": _ON_FAILURE,
        **dict.fromkeys(("switch", "cases", "case", "match", "elif"), _SWITCH),
        **dict.fromkeys(("try", "except", "catch"), _TRY),
        "then": "there is no then without if: the nodes of a sequence run one after the other",
    }

    def possible_outcomes(self, node: Node) -> PossibleOutcomes:
        """Return the possible outcomes, and report children that are never reached."""
        children = node.children(node.halted)
        node.check_reached([each.fails for each in children], "fails")
        return any_of(children)
