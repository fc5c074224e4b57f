"""The state of a node, computed from its recorded changes."""

from hardware.loading.dataclass import dataclass
from logs import shown_status

RUNNING, INVALID = "RUNNING", "INVALID"


@dataclass(frozen=True, slots=True)
class NodeState:
    """State of a node after some of its changes.

    Attributes:
        status: Last status; `HALTED` if it was interrupted.
        began, ended: Time of its last start and end [s]; None before the first.
        starts: Number of starts.
    """

    status: str = INVALID
    began: float | None = None
    ended: float | None = None
    starts: int = 0

    def after(self, status: str, time: float) -> "NodeState":
        """Return the state after a change of status at a time [s]."""
        began, ended, starts = self.began, self.ended, self.starts
        ran, runs = self.status == RUNNING, status == RUNNING
        status = shown_status(status, self.status)
        if time == (began if runs else ended) or (status == INVALID and not ran):
            return NodeState(status, began, ended, starts)  # the status did not change
        if runs or not ran:  # a node may start and end within one tick
            began, starts = time, starts + 1
        return NodeState(status, began, None if runs else time, starts)
