"""The lifecycle of the hardware, in the interface of a lifecycle node of ROS 2."""

from typing import Any

from lifecycle_msgs.msg import State as RosState, Transition, TransitionDescription, TransitionEvent
from lifecycle_msgs.srv import ChangeState, GetAvailableStates, GetAvailableTransitions, GetState

import logs
from executive.api.events import Event
from executive.errors import ClientError
from hardware.arm.lifecycle import EDGES
from logs.records.ros_lifecycle import REQUEST_NUMBERS, STATE_NUMBERS, transition_number

from .bridge import Bridge
from .node import Node

_UNKNOWN = "unknown"
_RAISE_ERROR = "raise_error"  # only the arm itself requests this transition


class HardwareLifecycle:
    """Serves the lifecycle of the arm as the lifecycle of the node.

    Args:
        node: The node.
        bridge: Connection to the server of the arm.
    """

    def __init__(self, node: Node, bridge: Bridge) -> None:
        self._node, self._bridge = node, bridge
        self._publish = node.publisher(TransitionEvent, "~/transition_event")
        node.serve(ChangeState, "~/change_state", self._change)
        node.serve(GetState, "~/get_state", self._state)
        node.serve(GetAvailableStates, "~/get_available_states", self._states)
        node.serve(GetAvailableTransitions, "~/get_available_transitions", self._available)
        node.serve(GetAvailableTransitions, "~/get_transition_graph", self._graph)
        bridge.on_event.append(self._changed)

    async def _change(self, request: Any, response: Any) -> None:
        wanted, arm = request.transition, self._bridge.arm
        for (start, label), number in REQUEST_NUMBERS.items():
            if start == arm and (wanted.label == label if wanted.label else wanted.id == number):
                break
        else:
            what = f"'{wanted.label}'" if wanted.label else wanted.id
            where = f"the arm is {arm}" if arm else "the server does not answer"
            self._bridge.log.warning(f"transition {what} is not possible: {where}")
            return
        try:
            await self._bridge.change_arm(label)
            response.success = True
        except ClientError as error:
            self._bridge.log.error(f"{label} failed: {error}")

    async def _state(self, request: Any, response: Any) -> None:
        response.current_state = _state(self._bridge.arm or _UNKNOWN)

    async def _states(self, request: Any, response: Any) -> None:
        response.available_states = [_state(name) for name in (_UNKNOWN, *STATE_NUMBERS)]

    async def _available(self, request: Any, response: Any) -> None:
        response.available_transitions = _transitions(self._bridge.arm)

    async def _graph(self, request: Any, response: Any) -> None:
        response.available_transitions = _transitions()

    def _changed(self, event: Event) -> None:
        if isinstance(event, logs.Transition):
            now = self._node.now()
            message = TransitionEvent(
                timestamp=now.sec * 10**9 + now.nanosec,
                transition=_transition(event.start, event.label),
                start_state=_state(event.start),
                goal_state=_state(event.goal),
            )
            self._publish(message)


def _state(name: str) -> Any:
    return RosState(id=STATE_NUMBERS.get(name, 0), label=name)


def _transition(start: str, label: str) -> Any:
    return Transition(id=transition_number(start, label), label=label)


def _transitions(state: str = "") -> list[Any]:
    """Return the transitions of ROS 2 from a state, or all if `state` is empty."""
    return [
        TransitionDescription(
            transition=_transition(start, label), start_state=_state(start), goal_state=_state(goal)
        )
        for label, start, goal in EDGES
        if label != _RAISE_ERROR and state in ("", start)
    ]
