"""The files that a tree is compiled from: subtrees, other tasks and poses."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from trees.declarations import Declaration
from trees.errors import FileError, Mistake, Mistakes
from trees.reading.grammar import SubtreeFile, TaskFile
from trees.reading.library import Library, poses_of
from trees.reading.specs import SubtreeNode, TreeNode

_SHOWN = 20  # numbers in a message


@dataclass(frozen=True)
class Source:
    """A subtree, or a task that another one runs.

    Attributes:
        name: Name of the subtree or task.
        tree: Root of its tree.
        declared: Its ports or parameters.
        what: `port` or `parameter`.
        certain: Whether all of them could be read.
    """

    name: str
    tree: TreeNode
    declared: Mapping[str, Declaration]
    what: str
    certain: bool


class _AnyPose(dict[str, Mapping[str, float]]):
    """Poses of a file that cannot be read. Any name may be a pose, so none is reported."""

    def __contains__(self, name: object) -> bool:
        return True

    def __missing__(self, name: str) -> Mapping[str, float]:
        return {}


class Sources:
    """Reads files for one tree, and records which are used.

    Args:
        library: Library of the files.

    Attributes:
        files: Texts of the files that were used, by name.
        poses: Joint positions [rad] by joint name, by name of the pose.
    """

    def __init__(self, library: Library) -> None:
        self._library = library
        self._read: dict[str | int, Source | None] = {}
        self._pose_files: Mapping[str, str] = {}
        self.files: dict[str, str] = {}
        self.poses: Mapping[str, Mapping[str, float]] = {}

    def load_poses(self, mistakes: Mistakes) -> None:
        """Read all poses."""
        try:
            files, wrong = self._library.draft_poses()
        except FileError as error:
            self.poses = _AnyPose()
            mistakes.take(error.mistakes)
            return
        self.poses = poses_of(files)
        mistakes.take(wrong)
        if not wrong:
            _, self._pose_files = self._library.poses()

    def use_poses(self) -> None:
        """Record that a pose was used."""
        self.files |= self._pose_files

    def get(self, spec: SubtreeNode, mistakes: Mistakes) -> Source | None:
        """Return a subtree or task, or None if it cannot be read, which is reported once."""
        if spec.source not in self._read:
            self._read[spec.source] = None
            try:
                self._read[spec.source] = self._load(spec, mistakes)
            except FileError as error:
                mistakes.take(error.mistakes)
        return self._read[spec.source]

    def _load(self, spec: SubtreeNode, mistakes: Mistakes) -> Source | None:
        file: SubtreeFile | TaskFile
        if isinstance(spec.source, str):
            file, wrong = self._library.subtree(spec.source, spec.place)
            certain = _certain(wrong, "ports")
            source = Source(spec.source, file.tree, file.ports, "port", certain)
        elif spec.source not in (numbers := self._library.numbers()):
            there = ", ".join(map(str, numbers[:_SHOWN])) + (", …" if numbers[_SHOWN:] else "")
            mistakes.add(spec.place, f"no task {spec.source}; there are {there}")
            return None
        else:
            file, wrong = self._library.draft(spec.source)
            certain = _certain(wrong, "parameters")
            source = Source(file.name, file.tree, file.parameters, "parameter", certain)
        mistakes.take(wrong)
        self.files[file.path.name] = file.text
        return source


def _certain(wrong: Iterable[Mistake], key: str) -> bool:
    """Return whether all ports or parameters of a file could be read."""
    return not any(mistake.place.location in ("", key) for mistake in wrong)
