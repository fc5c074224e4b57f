"""The interface of a kind of control node: all its properties for the rest of armtree.

A kind is a subclass of `ControlNodeKind`. The definition of its class registers it in `KINDS`.
Reading, compilation, analysis and export use only this interface.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from enum import Enum, auto
from typing import Any, ClassVar, Protocol

from py_trees.behaviour import Behaviour

from hardware.loading.dataclass import dataclass
from skills import Context
from trees.declarations import Declaration
from trees.errors import Place

Options = Mapping[str, Any]
Element = tuple[str, Mapping[str, str]]  # tag and attributes of an XML element

MAX_DURATION = 86_400.0  # [s]


class Flow(Enum):
    """Order in which the children of a node run, if the node succeeds."""

    SEQUENCE = auto()  # all children, one after the other
    ALTERNATIVES = auto()  # one child; it is unknown which one
    PARALLEL = auto()  # all children, at the same time
    UNCERTAIN = auto()  # the child may have stopped anywhere
    UNKNOWN = auto()  # any children, in any order


@dataclass(frozen=True, slots=True)
class PossibleOutcomes:
    """Possible outcomes of a node.

    Attributes:
        succeeds: True if it can succeed.
        fails: True if it can fail.
        shortest: Shortest time until a success [s].
    """

    succeeds: bool = True
    fails: bool = True
    shortest: float = 0.0


class Node(Protocol):
    """A compiled node, with information about the nodes below it.

    Attributes:
        name: Its name.
        options: Values of its options, if it has children.
        halted: True if a node above may halt this node before it ends.
    """

    name: str
    options: Options
    halted: bool

    def below(self) -> Sequence["Node"]:
        """Return the children of the node."""

    def moves(self) -> bool:
        """Return True if a skill in the node moves the arm."""

    def action(self) -> str:
        """Return the name of the first skill in the node that is not a condition, or ""."""

    def lasting(self) -> Iterator["Node"]:
        """Yield the nodes that may take several ticks: this node, and nodes below it."""

    def is_constant(self) -> bool:
        """Return True if the result depends only on values that are known before the run."""

    def child(self, number: int, halted: bool) -> PossibleOutcomes:
        """Return the possible outcomes of a child; `halted` is True if it may be halted."""

    def children(self, halted: bool) -> list[PossibleOutcomes]:
        """Return the possible outcomes of all children."""

    def check_reached(self, continues: Sequence[bool], how: str) -> None:
        """Report children that are never reached.

        Args:
            continues: True for every child after which the next one can run.
            how: How a child must end so that the next child runs: "succeeds" or "fails".
        """

    def wrong(self, message: str, option: str = "", missing: str = "", kind: str = "") -> None:
        """Report a mistake of the node.

        Args:
            message: The mistake.
            option: The wrong option; empty if the whole node is wrong.
            missing: An option that the node lacks; empty if it lacks none.
            kind: Correct kind of control node; empty if the kind is not wrong.
        """

    def too_slow(self, option: str, shortest: float) -> None:
        """Report that the child of the node takes longer than the time of an option.

        Args:
            option: The option.
            shortest: Shortest time of the child [s].
        """


class ControlNodeKind(ABC):
    """A kind of node with children. Subclasses are registered in `KINDS` by name.

    Schemas and messages show the first line of a subclass's docstring.

    Attributes:
        name: Its key in task files.
        options: Keys at the level of the key of the node, with their declarations.
        placeholders: Assumed values of options that are unknown before the run, for the analysis.
            Default: the default of the option.
        many: True if it has a list of children, False if it has one.
        condition: Key of a second child that must be a condition; empty if there is none.
        only_asks: True if its child must be a condition.
        may_halt: True if it may halt running children.
        timed: True if it fails when its child takes too long.
        limit: Option that limits its rounds, such as `times`; empty if it has none.
        lasting: True if it may take several ticks even if its children end at once.
        order: Order of its children.
        node: Class of its nodes. The arguments are name, child, context, and the options by name;
            with a `condition`, a list of both children in place of the child.
        groot_tag: Name of the equivalent node of BehaviorTree.CPP, if that node has no ports.
        synonyms: Names of the kind in other languages and libraries, for corrections.
        other_options: Names of its options, by their names in other libraries.
        keywords: Messages for similar keywords of programming languages, by keyword. The nodes
            below such a keyword have another form.
    """

    name: ClassVar[str]
    options: ClassVar[Mapping[str, Declaration]] = {}
    placeholders: ClassVar[Mapping[str, Any]] = {}
    many: ClassVar[bool] = False
    condition: ClassVar[str] = ""
    only_asks: ClassVar[bool] = False
    may_halt: ClassVar[bool] = False
    timed: ClassVar[bool] = False
    limit: ClassVar[str] = ""
    lasting: ClassVar[bool] = False
    order: ClassVar[Flow] = Flow.SEQUENCE
    node: ClassVar[Callable[..., Behaviour]]
    groot_tag: ClassVar[str] = ""
    synonyms: ClassVar[tuple[str, ...]] = ()
    other_options: ClassVar[Mapping[str, str]] = {}
    keywords: ClassVar[Mapping[str, str]] = {}

    def __init_subclass__(cls, register: bool = True) -> None:
        """Register the kind."""
        if register:
            KINDS[cls.name] = cls()

    @property
    def description(self) -> str:
        """Description in a few words."""
        first = (type(self).__doc__ or "").partition("\n")[0].rstrip(".")
        return first[:1].lower() + first[1:]

    def make(
        self, name: str, children: list[Behaviour], options: Options, context: Context
    ) -> Behaviour:
        """Return a node. A child that must be a condition is the last one."""
        given = children if self.condition else children[0]
        return type(self).node(name, given, context, **options)

    def label(self, options: Options) -> str:
        """Return the name of the node in drawings."""
        return self.name.replace("_", " ")

    def flow(self, options: Options) -> Flow:
        """Return the order of its children."""
        return self.order

    def rounds(self, options: Options) -> int | None:
        """Return how often each child succeeds if the node succeeds; None for any number."""
        return 1

    def lasts(self, options: Options) -> bool:
        """Return True if the node may take several ticks even if its children end at once."""
        return self.lasting

    def check(self, node: Node) -> None:
        """Report mistakes that do not depend on the outcomes of the children."""
        return

    @abstractmethod
    def possible_outcomes(self, node: Node) -> PossibleOutcomes:
        """Return the possible outcomes of a node, and report mistakes."""

    def groot(self, options: Options) -> list[Element]:
        """Return the equivalent nodes of BehaviorTree.CPP, each the parent of the next node.

        The condition of a guard becomes the first child.
        """
        return [(self.groot_tag, {})]


KINDS: dict[str, ControlNodeKind] = {}


def reserved_names() -> set[str]:
    """Return the names that no skill may have: kinds of nodes, and other keys of a node."""
    return {*KINDS, "subtree", "task", "name", "with"}


@dataclass(frozen=True, slots=True)
class Control:
    """Kind and options of a compiled node.

    Attributes:
        kind: Kind of the node.
        options: Values of its options.
        places: Places of the options that the file gives.
    """

    kind: ControlNodeKind
    options: Options
    places: Mapping[str, Place]


def all_of(outcomes: Sequence[PossibleOutcomes], shortest: float) -> PossibleOutcomes:
    """Return the outcomes of a node that succeeds if all its children succeed."""
    succeeds = all(each.succeeds for each in outcomes)
    return PossibleOutcomes(succeeds, any(each.fails for each in outcomes), shortest)


def any_of(outcomes: Sequence[PossibleOutcomes]) -> PossibleOutcomes:
    """Return the outcomes of a node that succeeds if any of its children succeeds."""
    return PossibleOutcomes(
        any(each.succeeds for each in outcomes),
        all(each.fails for each in outcomes),
        min(each.shortest for each in outcomes),
    )


def duration(description: str, default: float | None = None, least: float = 0.0) -> Declaration:
    """Declare an option that is a time [s]."""
    return Declaration(
        "duration", default=default, least=least, most=MAX_DURATION, description=description
    )


def count(description: str, optional: bool = False) -> Declaration:
    """Declare an option that is a count, from 1 to 1,000,000."""
    return Declaration(
        "integer", optional=optional, least=1, most=1_000_000, description=description
    )
