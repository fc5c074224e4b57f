"""The files that trees are taken from, read once each."""

from collections.abc import Mapping
from dataclasses import dataclass

from trees import Declaration, FileError, Library, Mistakes, SubtreeNode, TreeNode

_SHOWN = 20  # numbers in a message


@dataclass(frozen=True)
class Source:
    """A file that a tree is taken from: a subtree, or a task that another one runs.

    Attributes:
        name: Of the subtree or task.
        tree: What to do.
        declared: Its ports or parameters.
        what: Which of these.
    """

    name: str
    tree: TreeNode
    declared: Mapping[str, Declaration]
    what: str


class _AnyPose(dict[str, Mapping[str, float]]):
    """Poses of a file that is wrong: any name may be one of them, so that none is blamed."""

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
            self.poses, self._pose_files = self._library.poses()
        except FileError as error:
            self.poses = _AnyPose()
            _tell(error, mistakes)

    def use_poses(self) -> None:
        """Note that a pose was used."""
        self.files |= self._pose_files

    def get(self, spec: SubtreeNode, mistakes: Mistakes) -> Source | None:
        """The file of a subtree or task; None where it is wrong, which is told once."""
        if spec.source not in self._read:
            self._read[spec.source] = None
            try:
                self._read[spec.source] = self._load(spec, mistakes)
            except FileError as error:
                _tell(error, mistakes)
        return self._read[spec.source]

    def _load(self, spec: SubtreeNode, mistakes: Mistakes) -> Source | None:
        if isinstance(spec.source, str):
            file, wrong = self._library.subtree(spec.source, spec.place)
            path, text = file.path, file.text
            source = Source(file.name, file.tree, file.ports, "port")
        elif spec.source not in (numbers := self._library.numbers()):
            there = ", ".join(map(str, numbers[:_SHOWN])) + (", …" if numbers[_SHOWN:] else "")
            mistakes.add(spec.place, f"no task {spec.source}; there are {there}")
            return None
        else:
            task, wrong = self._library.draft(spec.source)
            path, text = task.path, task.text
            source = Source(task.name, task.tree, task.parameters, "parameter")
        if wrong:
            raise FileError(wrong)
        self.files[path.name] = text
        return source


def _tell(error: FileError, mistakes: Mistakes) -> None:
    for mistake in error.mistakes:
        mistakes.add(mistake.place, mistake.message)
