"""What a thread is at, by its stack: for one that does not come back to say so itself."""

import sys
from threading import Thread

from py_trees.behaviour import Behaviour

from trees.compile.paths import paths


def blocked_node(thread: Thread, root: Behaviour) -> str:
    """Path of the node whose code a thread is in; empty where it is in none."""
    known = {id(node): path for node, path in paths(root)}
    frame = sys._current_frames().get(thread.ident or 0)
    while frame:
        if path := known.get(id(frame.f_locals.get("self"))):
            return path
        frame = frame.f_back
    return ""
