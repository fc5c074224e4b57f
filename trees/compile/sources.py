"""The source files of a tree: subtrees, other tasks and poses."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from hardware import Robot
from hardware.spelling import there_are_numbers
from trees.errors import FileError, Mistake, Mistakes, Place
from trees.reading.document import nested
from trees.reading.grammar import PosesFile, TaskFile
from trees.reading.library import Library, poses_of
from trees.reading.specs import SubtreeNode

from .move_words import wrong_units


class _AnyPose(dict[str, Mapping[str, float]]):
    """The poses of unreadable files. Every name may be a pose, so no name is reported."""

    def __contains__(self, name: object) -> bool:
        return True

    def __missing__(self, name: str) -> Mapping[str, float]:
        return {}


class Sources:
    """Reads the files of one tree, and records the used files.

    Args:
        library: Library of the files.

    Attributes:
        files: Texts of the files that were used, by name.
        uncertain: Numbers of tasks and names of subtrees with unreadable parameters or ports.
        poses: Joint positions [rad] by joint name, by name of the pose.
    """

    def __init__(self, library: Library) -> None:
        self._library = library
        self._read: dict[str | int, TaskFile | None] = {}
        self._pose_files: Mapping[str, str] = {}
        self.files: dict[str, str] = {}
        self.uncertain: set[str | int] = set()
        self.poses: Mapping[str, Mapping[str, float]] = {}

    def load_poses(self, mistakes: Mistakes, robot: Robot) -> None:
        """Read all poses into `poses`, and check the units of their values."""
        try:
            files, wrong = self._library.draft_poses()
        except FileError as error:
            self.poses = _AnyPose()
            mistakes.take(error.mistakes)
            return
        self.poses = poses_of(files)
        mistakes.take(with_joints(wrong, files, robot))
        for file in files:
            for name, pose in file.labels.items():
                found = Mistakes()
                wrong_units(pose, robot, found.add)
                mistakes.take(replace(m, message=f"{name}: {m.message}") for m in found.found)
        if not wrong:
            _, self._pose_files = self._library.poses()

    def use_poses(self) -> None:
        """Record in `files` that a pose was used."""
        self.files |= self._pose_files

    def get(self, spec: SubtreeNode, mistakes: Mistakes) -> TaskFile | None:
        """Return a subtree or task. Report an unreadable file once and return None."""
        if spec.source not in self._read:
            self._read[spec.source] = None
            try:
                self._read[spec.source] = self._load(spec, mistakes)
            except FileError as error:
                mistakes.take(error.mistakes)
        return self._read[spec.source]

    def _load(self, spec: SubtreeNode, mistakes: Mistakes) -> TaskFile | None:
        source, numbers = spec.source, self._library.numbers()
        if isinstance(source, int) and source not in numbers:
            place = spec.named.place if spec.named else spec.place
            mistakes.add_last(place, f"no task {source}; {there_are_numbers(source, numbers)}")
            return None
        file, wrong = self._library.draft(source)
        if {"", f"{file.port}s"} & {mistake.place.location for mistake in wrong}:
            self.uncertain.add(source)
        mistakes.take(wrong)
        self.files[file.path.name] = file.text
        return file


def with_joints(
    mistakes: Sequence[Mistake], files: Sequence[PosesFile], robot: Robot
) -> list[Mistake]:
    """Return mistakes of poses. For a list of values or a pose in a pose, suggest joint names."""
    groups = [[joint.name for joint in robot.actuated_in(group)] for group in robot.groups]
    poses, better = poses_of(files), dict[Place, Mistake]()
    for pose in (pose for file in files for pose in file.labels.values()):
        items = pose.value if isinstance(pose.value, list) else []
        names = next((each for each in groups if items and len(each) == len(items)), [])
        if names:
            pairs = zip(names, (item.as_yaml() for item in items), strict=True)
            near = f"{{{', '.join(map(': '.join, pairs))}}}"
            why = f"{pose} has no names of joints; write {near}"
            better[pose.place] = Mistake(pose.place, why, pose.instead(near))
        for key, item in nested(pose).items():
            if isinstance(item.value, str) and item.value in poses:
                joints = poses[item.value].items()
                near = ", ".join(f"{joint}: {position:.4g}" for joint, position in joints)
                why = f"{item.value} is a pose, not an angle; write its joints: {near}"
                right = item.label.replaced(f"{key}: {item.value}", near)
                better[item.place] = Mistake(item.place, why, right)
    return [better.get(each.place, each) for each in mistakes]
