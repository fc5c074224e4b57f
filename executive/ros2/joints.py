"""The topics that draw the arm: `/joint_states` and `/robot_description`."""

import asyncio
import re
from contextlib import suppress

from sensor_msgs import msg
from std_msgs.msg import Header, String

from executive.api.events import Event, Where
from executive.api.joint_state import JointState
from executive.errors import ClientError
from hardware import Ability, Robot

from .bridge import Bridge
from .node import Node

_PERIOD = 0.1  # longest time between two messages while the arm is active [s]
_MESH = re.compile(r'filename="(?!\w+://)([^"]+)"')


class Joints:
    """Publishes the state of the joints: measured if the board measures, else commanded.

    Args:
        node: The node.
        bridge: Connection to the server of the arm.
    """

    def __init__(self, node: Node, bridge: Bridge) -> None:
        self._node, self._bridge, robot = node, bridge, bridge.robot
        self._measures = robot.can(Ability.MEASURE)
        self._state: JointState | None = None  # last published state
        self._published = asyncio.Event()
        self._publish_joints = node.publisher(msg.JointState, "joint_states")
        node.publisher(String, "robot_description", latched=True)(String(data=description(robot)))
        bridge.on_event.append(self._handle)

    async def run(self) -> None:
        """Repeat the last position of an active arm, for programs that expect a recent one."""
        while True:
            self._published.clear()
            with suppress(TimeoutError):
                async with asyncio.timeout(_PERIOD):
                    await self._published.wait()
                    continue
            if self._bridge.arm != "active":
                self._state = None
            elif self._state:
                self._publish(self._state)
            else:
                with suppress(ClientError):
                    self._handle(await self._bridge.client.where())

    def _handle(self, report: Event | Where) -> None:
        """Publish the state of the joints in a report, if it has one."""
        robot, state = self._bridge.robot, JointState.of(report, self._measures)
        if state is None:
            return
        names = [joint.name for joint in robot.actuated]
        if state.position.keys() != {*names}:
            words = f"the arm has the joints {', '.join(state.position)}, not {', '.join(names)}"
            self._bridge.log.error(f"{words}; name its robot file: --robot FILE", once=True)
            return
        self._state = state.of_all_joints(robot)
        self._publish(self._state)

    def _publish(self, state: JointState) -> None:
        self._published.set()
        message = msg.JointState(
            header=Header(stamp=self._node.now(), frame_id=state.frame_id),
            name=list(state.position),
            position=list(state.position.values()),
            velocity=list(state.velocity.values()),
            effort=list(state.effort.values()),
        )
        self._publish_joints(message)


def description(robot: Robot) -> str:
    """Return the URDF of a robot, in which the meshes are file URLs."""
    text = robot.urdf.read_text()
    return _MESH.sub(lambda name: f'filename="{robot.mesh(name[1]).resolve().as_uri()}"', text)
