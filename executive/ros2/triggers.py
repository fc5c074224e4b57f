"""Services for programs without the type of the action: one per task, and one for a stop."""

import re
from collections.abc import Callable
from typing import Any

from std_srvs.srv import Trigger

from executive.client.values import Task
from executive.errors import ClientError

from .bridge import Bridge
from .node import Node


class Triggers:
    """Serves `~/stop`, and `~/run_NAME` for every task.

    Args:
        node: The node.
        bridge: Connection to the server of the arm.
    """

    def __init__(self, node: Node, bridge: Bridge) -> None:
        self._node, self._bridge = node, bridge
        self._withdraw: dict[tuple[str, str], Callable[[], object]] = {}
        node.serve(Trigger, "~/stop", self._stop)
        bridge.on_tasks.append(self._update)

    def _update(self) -> None:
        """Offer the present tasks of the server."""
        offered = {service_name(task): task.name for task in self._bridge.tasks}.items()
        for service in self._withdraw.keys() - offered:
            self._withdraw.pop(service)()
        for name, task in offered - self._withdraw.keys():
            self._withdraw[name, task] = self._node.serve(Trigger, name, self._runs(task))

    def _runs(self, task: str) -> Any:
        async def run(request: Any, response: Any) -> None:
            try:
                goal = await self._bridge.send(task)
            except ClientError as error:
                response.message = str(error)
                return
            goal = await self._bridge.goals.end(goal.identity)
            assert goal.outcome
            response.success, response.message = goal.outcome.success, goal.outcome.text()

        return run

    async def _stop(self, request: Any, response: Any) -> None:
        try:
            canceled = (await self._bridge.client.stop()).goals
        except ClientError as error:
            response.message = f"NOT STOPPED: {error}"
            return
        response.success, response.message = True, f"stopped; canceled goals: {len(canceled)}"


def service_name(task: Task) -> str:
    """Return the name of a task's service. Characters that ROS does not allow become `_`."""
    return f"~/run_{re.sub('[^A-Za-z0-9_]', '_', task.name)}"
