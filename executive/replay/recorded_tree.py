"""The tree of a recorded run: the state of every node, and its times."""

from dataclasses import dataclass, field
from pathlib import Path

from logs import Goal, NodeStatus, Recording, RecordingError
from trees.export.outline import Entry

_HALTED = "HALTED"  # INVALID after RUNNING
_DEEPEST = 200  # a node in more nodes is refused; another program wrote it


@dataclass
class _Node:
    """A node of the tree.

    Attributes:
        name: Its name.
        state: Its last state.
        message: Its last message.
        first: When it first started [s]; None if it never did.
        since: When it last started [s]; None if it is not running.
        spent: Total time that it ran [s].
        below: Its children, by path.
    """

    name: str
    state: str = "INVALID"
    message: str = ""
    first: float | None = None
    since: float | None = None
    spent: float = 0.0
    below: "dict[str, _Node]" = field(default_factory=dict)

    def change(self, status: str, message: str, time: float) -> None:
        """Apply a change of status."""
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
        """Return the node as it is drawn.

        Args:
            zero: Time of the goal [s].
        """
        children = tuple(child.entry(zero) for child in self.below.values())
        return Entry(self.name, self.name, children, state=self.state, note=self._note(zero))

    def _note(self, zero: float) -> str:
        if self.first is None:
            return ""
        took = f", {self.spent:.3f} s" if self.spent else ""
        return f"+{self.first - zero:.3f} s{took}  {self.message}".rstrip()


def tree_of(path: Path) -> Entry:
    """Return the tree of a run.

    Args:
        path: The recording; it may be cut off.

    Raises:
        RecordingError: The recording cannot be read, or holds no tree.
    """
    zero = 0.0
    nodes: dict[str, _Node] = {}
    for record in Recording(path).records(Goal, NodeStatus):
        if isinstance(record, Goal):
            zero = record.time
        elif isinstance(record, NodeStatus):
            if record.path not in nodes:
                if record.path.count("/") > _DEEPEST:
                    raise RecordingError(path, f"its tree is deeper than {_DEEPEST} nodes")
                above = nodes.get(record.path.rpartition("/")[0])
                nodes[record.path] = node = _Node(record.name)
                if above:
                    above.below[record.path] = node
            nodes[record.path].change(record.status, record.message, record.time)
    if not nodes:
        raise RecordingError(path, "no tree was run; give a recording of a task")
    return next(iter(nodes.values())).entry(zero)
