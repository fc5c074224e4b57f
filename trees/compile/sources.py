"""The files that trees are taken from, read once each."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from trees.declarations import Declaration
from trees.errors import FileError, Mistake
from trees.reading.grammar import SubtreeFile, TaskFile
from trees.reading.library import Library, poses_of
from trees.reading.node_parser import Mistakes
from trees.reading.specs import SubtreeNode, TreeNode

_SHOWN = 20  # numbers in a message


@dataclass(frozen=True)
class Source:
    """A file that a tree is taken from: a subtree, or a task that another one runs.

    Attributes:
        name: Of the subtree or task.
        tree: What to do.
        declared: Its ports or parameters.
        what: Which of these.
        certain: Whether these are all.
    """

    name: str
    tree: TreeNode
    declared: Mapping[str, Declaration]
    what: str
    certain: bool


class _AnyPose(dict[str, Mapping[str, float]]):
    """Poses of a file that cannot be read: any name may be one of them, so that none is blamed."""

    def __contains__(self, name: object) -> bool:
        return True

    def __missing__(self, name: str) -> Mapping[str, float]:
        return {}


class Sources:
    """Reads files.

    Args:
        library: Where they are.

    Attributes:
        files: What was used, by name.
        poses: Joint values [rad] by joint name, by the name of the pose.
    """

    def __init__(self, library: Library) -> None:
        self._library = library
        self._read: dict[str | int, Source | None] = {}
        self._pose_files: Mapping[str, str] = {}
        self.files: dict[str, str] = {}
        self.poses: Mapping[str, Mapping[str, float]] = {}

    def load_poses(self, mistakes: Mistakes) -> None:
        """Read the poses there are."""
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
        """Note that a pose was used."""
        self.files |= self._pose_files

    def get(self, spec: SubtreeNode, mistakes: Mistakes) -> Source | None:
        """The file of a subtree or task; None where it cannot be read, which is told once."""
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
    """Whether all that a file declares could be read."""
    return not any(mistake.place.way in ("", key) for mistake in wrong)
