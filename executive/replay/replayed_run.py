"""The tree of a run as its recording tells it: what became of every node, and when."""

from dataclasses import dataclass, field
from pathlib import Path

from logs import Goal, NodeStatus, Recording, RecordingError
from trees.export.outline import Entry

_HALTED = "HALTED"  # INVALID after RUNNING


@dataclass
class _Node:
    """What is known of a node so far.

    Attributes:
        name: Its name.
        state: What became of it.
        message: What it said last.
        first: When it began first [s].
        since: When it began last; None where it does not run [s].
        spent: How long it ran, all in all [s].
        below: Its children, by their paths.
    """

    name: str
    state: str = "INVALID"
    message: str = ""
    first: float | None = None
    since: float | None = None
    spent: float = 0.0
    below: "dict[str, _Node]" = field(default_factory=dict)

    def take(self, status: str, message: str, time: float) -> None:
        """Note a change."""
        if status == "INVALID" and self.state == "INVALID":
            return
        if self.first is None:
            self.first = time
        if self.since is not None:
            self.spent, self.since = self.spent + time - self.since, None
        if status == "RUNNING":
            self.since = time
        self.state = _HALTED if status == "INVALID" else status
        self.message = message or self.message

    def entry(self, zero: float) -> Entry:
        """As it is drawn; times are since the goal [s]."""
        children = tuple(child.entry(zero) for child in self.below.values())
        return Entry(self.name, self.name, children, state=self.state, note=self._note(zero))

    def _note(self, zero: float) -> str:
        if self.first is None:
            return ""
        took = f", {self.spent:.3f} s" if self.spent else ""
        return f"+{self.first - zero:.3f} s{took}  {self.message}".rstrip()


def tree_of(path: Path) -> Entry:
    """The tree of a run.

    Args:
        path: Its recording; of one that was cut off, what is there.

    Raises:
        RecordingError: It cannot be read, or no tree was run.
    """
    zero = 0.0
    nodes: dict[str, _Node] = {}
    for record in Recording(path).records(Goal, NodeStatus):
        if isinstance(record, Goal):
            zero = record.time
        elif isinstance(record, NodeStatus):
            if record.path not in nodes:
                nodes[record.path] = node = _Node(record.name)
                if above := nodes.get(record.path.rpartition("/")[0]):
                    above.below[record.path] = node
            nodes[record.path].take(record.status, record.message, record.time)
    if not nodes:
        raise RecordingError(path, "no tree was run; give a recording of a task")
    return next(iter(nodes.values())).entry(zero)
