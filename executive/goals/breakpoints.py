"""Breakpoints: a run pauses before a node starts."""

from typing import TYPE_CHECKING

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.errors import NoSuchNode
from hardware.spelling import suggestion
from trees.build import Tree
from trees.compile.node_paths import paths

from .mailbox import Mailbox

if TYPE_CHECKING:
    from trees.live_library import LiveLibrary

_SHOWN = 20  # largest number of nodes in a message


def check_node(library: "LiveLibrary", path: str) -> None:
    """Check that a task has a node with this path.

    Args:
        library: The tasks.
        path: Path of a node, which begins with the name of its task.

    Raises:
        NoSuchNode: No task has such a node.
        TreeError: The folder of the tasks cannot be read, or the task is not valid.
    """
    tasks = library.latest.names()
    name = path.partition("/")[0]
    if name not in tasks:
        likely = suggestion(name, tasks) or f"; a path begins with a task: {', '.join(tasks)}"
        raise NoSuchNode(f"no task is called {name}{likely}")
    nodes = [row["path"] for row in library.nodes(tasks[name])]
    if path not in nodes:
        there = ", ".join(nodes[:_SHOWN]) + suggestion(path, nodes)
        raise NoSuchNode(f"{name} has no node {path}; there are {there}")


class Breakpoints:
    """The breakpoints of one run; for the executor thread only.

    Args:
        marked: Paths of the nodes with a breakpoint. A breakpoint at an inner node applies to the
            first skill in its subtree that starts. All runs share the set, which may change.
        mailbox: Mailbox of the run.
    """

    def __init__(self, marked: set[str], mailbox: Mailbox) -> None:
        self._marked, self._mailbox = marked, mailbox
        self._paths: dict[Behaviour, str] = {}
        self._held: set[Behaviour] = set()

    def use(self, tree: Tree) -> None:
        """Set the paths of the nodes of a tree."""
        self._paths = dict(paths(tree.root))

    def hold(self, skill: Behaviour) -> bool:
        """Pause the run if a skill is at a breakpoint.

        Returns:
            True if the skill must not start yet.
        """
        if skill in self._held:
            self._held.discard(skill)
            return False
        mailbox = self._mailbox
        if not (mailbox.stepping or mailbox.paused or self._is_marked(skill)):
            return False
        self._held.add(skill)
        mailbox.pause()
        return True

    def _is_marked(self, skill: Behaviour) -> bool:
        """Return True if the skill, or an inner node that starts with it, has a breakpoint."""
        node: Behaviour | None = skill
        while node is not None and node.status is not Status.RUNNING:
            if self._paths.get(node) in self._marked:
                return True
            node = node.parent
        return False
