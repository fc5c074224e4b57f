"""The nodes that hold others: made from their specs, with what is known of keys on every branch."""

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from py_trees.behaviour import Behaviour
from py_trees.composites import Selector, Sequence
from py_trees.decorators import FailureIsSuccess, Inverter

from hardware.suggestions import choices
from skills import Context, Skill
from trees.analysis.data_flow import Keys
from trees.nodes.control import (
    Guard,
    ReactiveSelector,
    ReactiveSequence,
    Repeat,
    Retry,
    Timeout,
    WaitFor,
)
from trees.nodes.parallel import Join, Race
from trees.reading.document import REFUSED, Located
from trees.reading.specs import KINDS, ControlNode, Key, SkillNode, TreeNode
from trees.reading.values import Declaration

from .scope import Scope

# Options that are given only when the task is called, as what ends and hurries nothing.
_UNKNOWN: Mapping[str, Any] = {"times": 1, "attempts": 1, "after": math.inf}

if TYPE_CHECKING:
    from .assembly import TreeCompiler


class Branches:
    """Makes the nodes that hold others.

    Args:
        assembly: Makes what they hold.
        context: Whose clock.
    """

    def __init__(self, assembly: "TreeCompiler", context: Context) -> None:
        self._assembly, self._context = assembly, context

    def make(self, spec: ControlNode, scope: Scope, shown: str) -> Behaviour:
        """The node of a spec, with all below it."""
        if not spec.kind:
            return self._unknown(spec, scope, shown)
        found = {
            option: self._option(spec, option, declared, scope)
            for option, declared in KINDS[spec.kind].options.items()
        }
        options = {option: value for option, value in found.items() if value is not REFUSED}
        wrong = {
            option: _UNKNOWN.get(option, KINDS[spec.kind].options[option].default)
            for option in found.keys() - options.keys()
        }
        options |= wrong
        make: Callable[..., Behaviour] = getattr(self, f"_{spec.kind}", self._decorator)
        node = make(spec, scope, shown or spec.kind, options)
        self._assembly.controls[node] = spec.kind, options
        if wrong:
            self._assembly.asking.doubtful.add(node)
        return node

    def _unknown(self, spec: ControlNode, scope: Scope, shown: str) -> Behaviour:
        """A node of which nobody knows what it does with those it holds."""
        children, ways = self._apart(spec, scope)
        for way in ways:
            self._assembly.keys.written |= way.written
        self._assembly.keys.unread = {}
        node = Join(shown or "?", children)
        self._assembly.asking.doubtful.add(node)
        return node

    def _option(self, spec: ControlNode, option: str, declared: Declaration, scope: Scope) -> Any:
        """What an option is; REFUSED where it is wrong."""
        value = self._assembly.resolve(spec.options.get(option), scope)
        if isinstance(value, Key) and value.name in scope.stand_ins:
            stand_in = Located(value.place, scope.stand_ins[value.name], value.label)
            self._assembly.fit(stand_in, declared, f"{spec.kind}: {option}")
            return _UNKNOWN.get(option, declared.default)
        if isinstance(value, Key):
            self._assembly.wrong(value.place, f"{spec.kind}: {option} must be known before the run")
            return REFUSED
        if value is None:
            return REFUSED if declared.needed else declared.default
        fitted = self._assembly.fit(value, declared, f"{spec.kind}: {option}")
        return REFUSED if fitted is None else fitted

    def _sequence(
        self, spec: ControlNode, scope: Scope, shown: str, options: Mapping[str, Any]
    ) -> Behaviour:
        children = [self._assembly.node(child, scope) for child in spec.children]
        if options["memory"] is False:
            self._check_asked(spec, children)
            return ReactiveSequence(shown, children, self._context)
        return Sequence(shown, memory=True, children=children)

    def _selector(
        self, spec: ControlNode, scope: Scope, shown: str, options: Mapping[str, Any]
    ) -> Behaviour:
        children, ways = self._apart(spec, scope)
        self._assembly.keys.join(ways)
        if options["memory"] is False:
            self._check_asked(spec, children)
            return ReactiveSelector(shown, children, self._context)
        return Selector(shown, memory=True, children=children)

    def _parallel(
        self, spec: ControlNode, scope: Scope, shown: str, options: Mapping[str, Any]
    ) -> Behaviour:
        children, ways = self._apart(spec, scope)
        if options["policy"] == "any":
            self._assembly.keys.join(ways)
        else:
            self._assembly.keys.gather(ways, self._assembly.mistakes)
        if sum(map(_moves, children)) > 1:
            self._assembly.wrong(spec.place, "only one node of a parallel may move the arm")
        return Race(shown, children) if options["policy"] == "any" else Join(shown, children)

    def _guard(
        self, spec: ControlNode, scope: Scope, shown: str, options: Mapping[str, Any]
    ) -> Behaviour:
        child, condition = (*spec.children, *[SkillNode(spec.place, "", {})] * 2)[:2]
        asked = self._condition(condition, scope)
        for below in asked.iterate():
            pauses = isinstance(below, Guard) and below.pause
            if pauses or isinstance(below, Retry | Repeat | WaitFor):
                self._assembly.wrong(
                    self._assembly.places[below],
                    f"{below.name} may take time, and while asks for an answer at once; the guard "
                    "asks again by itself",
                )
        children = [self._assembly.node(child, scope), asked]
        pause = options["otherwise"] == "pause"
        return Guard(shown, children, self._context, pause, options["every"])

    def _decorator(
        self, spec: ControlNode, scope: Scope, shown: str, options: Mapping[str, Any]
    ) -> Behaviour:
        (child,), context, before = spec.children, self._context, self._assembly.keys.copy()
        if spec.kind == "wait_for":
            asked = self._condition(child, scope)
            if self._settled(asked, scope):
                self._assembly.wrong(
                    child.place, "wait_for waits for nothing: its condition is known before the run"
                )
            return WaitFor(shown, asked, context, options["every"])
        node = self._assembly.node(child, scope)
        match spec.kind:
            case "retry":
                return Retry(shown, node, context, options["attempts"], options["backoff"])
            case "repeat":
                return Repeat(shown, node, context, options["times"])
            case "timeout":
                return Timeout(shown, node, context, options["after"])
            case "force_success":
                self._assembly.keys.join([before, self._assembly.keys])
                return FailureIsSuccess(shown, node)
            case _:
                self._assembly.keys.join([before, self._assembly.keys])
                return Inverter(shown, node)

    def _condition(self, spec: TreeNode, scope: Scope) -> Behaviour:
        node = self._assembly.node(spec, scope)
        there = [name for name, kind in self._assembly.known.items() if kind.condition]
        for name in _acting(node)[:1]:
            why = f"{name} acts, and cannot be a condition; there are {choices(name, there)}"
            self._assembly.wrong(spec.place, why)
        return node

    def _settled(self, asked: Behaviour, scope: Scope) -> bool:
        """Whether the answers of a condition follow from what is known before the run."""
        below = set(asked.iterate())
        leaves = [leaf for leaf in self._assembly.leaves if leaf.skill in below]
        return bool(leaves) and all(
            leaf.skill.pure and scope.stand_ins.keys() >= set(leaf.keys.values()) for leaf in leaves
        )

    def _check_asked(self, spec: ControlNode, children: list[Behaviour]) -> None:
        """See that what is done again and again, as long as a later node runs, only asks."""
        for child, node in zip(spec.children[:-1], children, strict=False):
            for name in _acting(node)[:1]:
                self._assembly.wrong(
                    child.place,
                    f"{name} acts, and without memory would begin anew for ever while a later node "
                    "runs; only conditions may stand before the last node",
                )

    def _apart(self, spec: ControlNode, scope: Scope) -> tuple[list[Behaviour], list[Keys]]:
        """Children of which none knows what another writes."""
        before, children, ways = self._assembly.keys, [], []
        for child in spec.children:
            self._assembly.keys = before.copy()
            children.append(self._assembly.node(child, scope))
            ways.append(self._assembly.keys)
        self._assembly.keys = before
        for way in ways:  # what one of them has read is read
            before.unread = {n: key for n, key in before.unread.items() if n in way.unread}
        return children, ways or [before]


def _acting(node: Behaviour) -> list[str]:
    """The skills that do more than ask."""
    skills = (below for below in node.iterate() if isinstance(below, Skill))
    return [skill.name for skill in skills if not skill.condition]


def _moves(node: Behaviour) -> bool:
    return any(isinstance(below, Skill) and below.moves for below in node.iterate())
