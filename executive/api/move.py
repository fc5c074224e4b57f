"""A move: a goal in words, without a task file."""

from collections.abc import Iterable, Mapping

from hardware.loading.dataclass import dataclass
from logs import MOVE

HOME = "home"  # the word for the home of the robot
LEADER = "leader"  # the word for a hand-guided arm: follow it until a person ends the move


@dataclass(frozen=True, slots=True)
class Move:
    """A request to move.

    Attributes:
        words: The target; see `read_words`. The word `home` is also a pose; see `poses_with_home`.
        relative: True if all words are changes: of joints, or of x, y, z of the tool.
        speed: Share of the robot's speed, `MIN_SPEED` to 1. The motion takes 1 / speed times as
            long.
    """

    words: tuple[str, ...]
    relative: bool = False
    speed: float = 1.0

    @classmethod
    def of(
        cls,
        to: Iterable[str | float],
        joints: Mapping[str, str | float],
        relative: bool,
        speed: float,
    ) -> "Move":
        """Return a move to a target that may contain numbers.

        Args:
            to: Words, or x, y, z of the tool [m]. A text may hold several words.
            joints: Targets of joints by name, as texts or numbers [rad].
            relative: True if all targets are changes.
            speed: Share of the robot's speed.
        """
        words = " ".join(map(str, to)).split()
        words += [f"{name}={value}" for name, value in joints.items()]
        return cls(tuple(words), relative, speed)


def number_of(task: int | Move) -> int:
    """Return the number of a task, or of a move."""
    return MOVE if isinstance(task, Move) else task
