"""Where a run holds before a node begins, so that it can be looked at and stepped through."""

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.errors import NoSuchNode
from hardware.suggestions import suggestion
from trees.build import Tree
from trees.compile.paths import paths
from trees.live_library import LiveLibrary

from .mailbox import Mailbox

_SHOWN = 20  # nodes in a message


def check_node(library: LiveLibrary, path: str) -> None:
    """Check that a task has a node with this path.

    Args:
        library: The tasks.
        path: Path of a node, which begins with the name of its task.

    Raises:
        NoSuchNode: No task has such a node.
        FileError: The folder of the tasks cannot be read.
    """
    tasks = {row["name"]: row["task"] for row in library.listed() if not row["wrong"]}
    name = path.partition("/")[0]
    if name not in tasks:
        likely = suggestion(name, tasks) or f"; it begins with a task's name: {', '.join(tasks)}"
        raise NoSuchNode(f"no task is called {name}{likely}")
    nodes = library.node_paths(tasks[name])
    if path not in nodes:
        there = ", ".join(nodes[:_SHOWN]) + suggestion(path, nodes)
        raise NoSuchNode(f"{name} has no node {path}; there are {there}")


class Breakpoints:
    """Those of one run; for its owner thread.

    Args:
        marked: Paths of the nodes to hold before; those of nodes with others below them count for
            the first of these that begins. Shared by all runs, and may change meanwhile.
        mailbox: Of the run.
    """

    def __init__(self, marked: set[str], mailbox: Mailbox) -> None:
        self._marked, self._mailbox = marked, mailbox
        self._paths: dict[Behaviour, str] = {}
        self._held: set[Behaviour] = set()

    def watch(self, tree: Tree) -> None:
        """Know the nodes of the tree that is run."""
        self._paths = dict(paths(tree.root))

    def holds(self, skill: Behaviour) -> bool:
        """Whether a skill is to wait before it begins; pauses the run for the first that is."""
        if skill in self._held:
            self._held.discard(skill)
            return False
        mailbox = self._mailbox
        if not (mailbox.stepping or mailbox.paused or self._reached(skill)):
            return False
        self._held.add(skill)
        mailbox.pause()
        return True

    def _reached(self, skill: Behaviour) -> bool:
        """Whether a mark stands at the skill, or at a node that begins with it."""
        node: Behaviour | None = skill
        while node is not None and node.status is not Status.RUNNING:
            if self._paths.get(node) in self._marked:
                return True
            node = node.parent
        return False
