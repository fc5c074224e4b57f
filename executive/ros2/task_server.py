"""The action server `task_server`: the protocol of ROS 2 actions for the server's goals.

rclpy's own action server keeps the goals in its process. This action server has no goals of its
own, so it also lists goals of other clients, and goals that were sent before its start.
"""

from contextlib import suppress
from typing import Any

from action_msgs.msg import GoalInfo, GoalStatus as RosStatus, GoalStatusArray
from action_msgs.srv import CancelGoal
from arduinobot_msgs.action import ArduinobotTask
from builtin_interfaces.msg import Time
from unique_identifier_msgs.msg import UUID

import logs
from executive.api.events import Event
from executive.api.outcome import GoalStatus
from executive.errors import ClientError, ServerUnreachable

from .bridge import Bridge
from .node import Node

ACTION = "task_server"
_TYPES = ArduinobotTask.Impl


class TaskServer:
    """Serves the action.

    Args:
        node: The node.
        bridge: Connection to the server of the arm.
    """

    def __init__(self, node: Node, bridge: Bridge) -> None:
        self._bridge, self._percentages = bridge, dict[str, int]()
        name = f"{ACTION}/_action"
        self._publish_status = node.publisher(GoalStatusArray, f"{name}/status", latched=True)
        self._publish_feedback = node.publisher(_TYPES.FeedbackMessage, f"{name}/feedback")
        node.serve(_TYPES.SendGoalService, f"{name}/send_goal", self._send)
        node.serve(_TYPES.GetResultService, f"{name}/get_result", self._result)
        node.serve(CancelGoal, f"{name}/cancel_goal", self._cancel)
        bridge.on_goal.append(self._goal_changed)
        bridge.on_event.append(self._progressed)
        self._publish_status(GoalStatusArray())

    async def _send(self, request: Any, response: Any) -> None:
        number = request.goal.task_number
        try:
            goal = await self._bridge.send(number, _identity(request.goal_id))
        except ClientError as error:
            self._bridge.log.warning(f"rejected a goal for task {number}: {error}")
            return
        response.accepted, response.stamp = True, _time(goal.stamp_ns)

    async def _result(self, request: Any, response: Any) -> None:
        identity = _identity(request.goal_id)
        if identity not in self._bridge.goals.known:
            with suppress(ServerUnreachable):
                await self._bridge.connected()  # a new node does not know the goals at first
        if identity in self._bridge.goals.known:
            goal = await self._bridge.goals.end(identity)
            response.status = goal.state.value
            response.result.success = bool(goal.outcome and goal.outcome.success)

    async def _cancel(self, request: Any, response: Any) -> None:
        identity, at = _identity(request.goal_info.goal_id), request.goal_info.stamp
        named = identity if any(request.goal_info.goal_id.uuid) else ""
        try:
            answer = await self._bridge.client.cancel(named, at.sec * 10**9 + at.nanosec)
        except ClientError as error:
            response.return_code = CancelGoal.Response.ERROR_REJECTED
            self._bridge.log.error(f"NOT STOPPED: {error}")
            return
        known = self._bridge.goals.known
        response.return_code = answer.code.value
        response.goals_canceling = [_info(known[each]) for each in answer.goals if each in known]

    def _goal_changed(self, goal: GoalStatus) -> None:
        if goal.outcome:
            self._percentages.pop(goal.identity, None)
        listed = [
            RosStatus(goal_info=_info(each), status=each.state.value)
            for each in self._bridge.goals.known.values()
        ]
        self._publish_status(GoalStatusArray(status_list=listed))

    def _progressed(self, event: Event) -> None:
        """Publish progress. It never decreases, and is 0 % while planning."""
        if not isinstance(event, logs.Feedback):
            return
        percentage = event.percentage or 0
        if percentage > self._percentages.get(event.goal_id, -1):
            self._percentages[event.goal_id] = percentage
            message = _TYPES.FeedbackMessage(goal_id=_uuid(event.goal_id))
            message.feedback.percentage = percentage
            self._publish_feedback(message)


def _identity(goal_id: Any) -> str:
    return bytes(goal_id.uuid).hex()


def _uuid(identity: str) -> Any:
    return UUID(uuid=list(bytes.fromhex(identity)))


def _time(stamp_ns: int) -> Any:
    return Time(sec=stamp_ns // 10**9, nanosec=stamp_ns % 10**9)


def _info(goal: GoalStatus) -> Any:
    return GoalInfo(goal_id=_uuid(goal.identity), stamp=_time(goal.stamp_ns))
