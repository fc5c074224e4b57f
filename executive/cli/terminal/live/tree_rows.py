"""The tree of a run as rows of text, folded to a given number of rows."""

import dataclasses
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field
from itertools import islice

import logs
from hardware.loading.dataclass import dataclass

_AT_WORK = ("RUNNING", logs.HALTED)
_ALL = 1 << 30
_COUNTS = {"SUCCESS": "done", "FAILURE": "failed", logs.HALTED: "stopped", "INVALID": "to come"}

# Degrees of folding, from none to most. Each has the number of levels shown below a node that is
# not at work, and the number of siblings shown on each side of a node at work. With -1, even the
# count of hidden siblings is left out.
_FOLDS = (
    (_ALL, _ALL),
    (2, _ALL),
    (1, _ALL),
    *((0, n) for n in (_ALL, 24, 16, 12, 8, 6, 5, 4, 3, 2, 1, 0, -1)),
)


@dataclass(frozen=True, slots=True)
class Row:
    """A row of the drawn tree.

    Attributes:
        guide: Lines of the drawn tree before the node, such as `│   └── `.
        status: Status of the node, `HALTED` if it was stopped; empty for a row of hidden nodes.
        name: Name of the node, or words for hidden nodes.
        message: Feedback message of the node, and the number of hidden nodes below the node.
        at_work: True if the node runs or was stopped, or if its failure failed its parent.
    """

    guide: str
    status: str
    name: str
    message: str
    at_work: bool = False


@dataclasses.dataclass(slots=True, eq=False)
class _Branch:
    node: logs.NodeStatus
    children: list["_Branch"] = field(default_factory=list)
    at_work: bool = False

    def size(self) -> int:
        """Return the number of nodes below this node."""
        return len(self.children) + sum(child.size() for child in self.children)


def tree_rows(nodes: Mapping[str, logs.NodeStatus], most: int) -> list[Row]:
    """Return the rows of a tree.

    A tree with too many rows is folded: first below nodes that are not at work, then among the
    siblings of nodes at work. If this is not enough, only rows around a node at work remain.

    Args:
        nodes: The nodes by path, parents first.
        most: Largest number of rows, at least 1.
    """
    root = _branches(nodes)
    for depth, near in _FOLDS:
        rows = list(islice(_rows(root, depth, near), most + 1))
        if len(rows) <= most:
            return rows
    return _window(list(_rows(root, depth, near)), most)


def _branches(nodes: Mapping[str, logs.NodeStatus]) -> _Branch:
    branches: dict[str, _Branch] = {}
    root: _Branch | None = None
    for path, node in nodes.items():
        branch = branches[path] = _Branch(node)
        above = branches.get(path.rpartition("/")[0])
        if above:
            above.children.append(branch)
            # The failure of a child matters if it caused the failure of its parent.
            failed = node.status == above.node.status == "FAILURE" and above.at_work
            branch.at_work = node.status in _AT_WORK or failed
        elif root is None:
            root, branch.at_work = branch, True
    assert root
    return root


def _rows(
    branch: _Branch,
    depth: int,
    near: int,
    *,
    first: str = "",
    rest: str = "",
    place: str = "",
    left: int = _ALL,
) -> Iterator[Row]:
    """Yield the rows of a branch.

    Args:
        branch: The branch.
        depth: Levels to show below a node that is not at work.
        near: Siblings to show on each side of a node at work.
        first: Guide of the first row of the branch.
        rest: Guide of the rows below.
        place: Text such as `2 of 5` if the siblings are not drawn, else empty.
        left: Number of levels to show below the branch.
    """
    node = branch.node
    left = depth if branch.at_work else min(left, depth)
    folded = bool(branch.children) and left == 0 and not branch.at_work
    count = f"{branch.size()} nodes" if folded and branch.size() > 1 else ""
    words = "  ".join(filter(None, (place, node.message, count)))
    yield Row(first, node.status, node.name, words, branch.at_work)
    if folded:
        return
    parts = list(_parts(branch.children, near))
    for part in parts:
        last = part is parts[-1]
        start, below = rest + ("└── " if last else "├── "), rest + ("    " if last else "│   ")
        if isinstance(part, str):
            yield Row(start, "", part, "")
        else:
            yield from _rows(
                part,
                depth,
                near,
                first=start,
                rest=below,
                place="" if near >= 0 else _place(part, branch.children),
                left=left - (not branch.at_work),
            )


def _place(child: _Branch, children: Sequence[_Branch]) -> str:
    return f"{children.index(child) + 1} of {len(children)}"


def _parts(children: Sequence[_Branch], near: int) -> Iterator[_Branch | str]:
    """Yield the children near children at work, with a text for the hidden children in each gap.

    If `near` is negative, yield only the children at work, or the last child that started.
    """
    at_work = [k for k, child in enumerate(children) if child.at_work]
    started = [k for k, child in enumerate(children) if child.node.status != "INVALID"]
    middles = at_work or started[-1:] or [0]
    if near < 0:
        yield from (children[k] for k in middles if k < len(children))
        return
    hidden: list[_Branch] = []
    for k, child in enumerate(children):
        if all(abs(k - middle) > near for middle in middles):
            hidden.append(child)
            continue
        yield from _hidden(hidden)
        hidden = []
        yield child
    yield from _hidden(hidden)


def _hidden(branches: Sequence[_Branch]) -> Iterator[_Branch | str]:
    """Yield a text with the numbers of hidden siblings. A single sibling is not hidden."""
    if len(branches) == 1:
        yield branches[0]
    elif branches:
        counts = Counter(_COUNTS.get(branch.node.status, "") for branch in branches)
        yield "… " + ", ".join(f"{count} {what}".rstrip() for what, count in counts.items())


def _window(rows: Sequence[Row], most: int) -> list[Row]:
    """Return the rows around the last row at work, and the numbers of other rows."""
    middle = max(k for k, row in enumerate(rows) if row.at_work)
    if most < 4:
        return list(rows[middle : middle + 1])
    start = max(0, min(middle - (most - 2) // 2, len(rows) - most + 1))
    reaches_an_end = start in (0, len(rows) - most + 1)
    end = start + most - (1 if reaches_an_end else 2)
    above, below = start, len(rows) - end
    over = [Row("", "", f"… {above} more above", "")] if above else []
    under = [Row("", "", f"… {below} more below", "")] if below else []
    return [*over, *rows[start:end], *under]
