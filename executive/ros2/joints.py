"""The topics that draw the arm: `/joint_states` and `/robot_description`."""

import asyncio
import re
from collections.abc import Mapping
from contextlib import suppress

from sensor_msgs.msg import JointState
from std_msgs.msg import Header, String

import logs
from executive.api.events import Event
from executive.errors import ClientError
from hardware import Ability, Robot, joint_positions

from .bridge import Bridge
from .node import Node

_PERIOD = 0.1  # longest time between two messages while the arm is active [s]
_MESH = re.compile(r'filename="(?!\w+://)([^"]+)"')


class Joints:
    """Publishes positions of the joints: measured ones if the board measures, else commanded.

    `frame_id` says which, because joint states do not use this field.

    Args:
        node: The node.
        bridge: The server of the arm.
    """

    def __init__(self, node: Node, bridge: Bridge) -> None:
        self._node, self._bridge, robot = node, bridge, bridge.robot
        self._measures = robot.can(Ability.MEASURE)
        self._positions: Mapping[str, float] = {}
        self._published = asyncio.Event()
        self._publish_joints = node.publisher(JointState, "joint_states")
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
                self._positions = {}
            elif self._positions:
                self._publish()
            else:
                with suppress(ClientError):
                    where = await self._bridge.client.where()
                    self._moved((where.measured if self._measures else where.commanded) or {})

    def _handle(self, event: Event) -> None:
        match event:
            case logs.Measured():
                self._moved(dict(zip(event.joints, event.position, strict=True)))
            case logs.Sent() if event.joints and not self._measures:
                self._moved(dict(zip(event.joints, event.positions, strict=True)))

    def _moved(self, actuated: Mapping[str, float]) -> None:
        """Publish positions by actuated joint [rad]."""
        names = [joint.name for joint in self._bridge.robot.actuated]
        if not actuated:
            return
        if actuated.keys() != set(names):
            words = f"the arm has the joints {', '.join(actuated)}, not {', '.join(names)}"
            self._bridge.log.error(f"{words}: give its robot file, --robot FILE", once=True)
            return
        positions = [actuated[name] for name in names]
        self._positions = joint_positions(self._bridge.robot, positions)
        self._publish()

    def _publish(self) -> None:
        self._published.set()
        kind = "measured" if self._measures else "commanded"
        message = JointState(
            header=Header(stamp=self._node.now(), frame_id=kind),
            name=list(self._positions),
            position=list(self._positions.values()),
        )
        self._publish_joints(message)


def description(robot: Robot) -> str:
    """Return the URDF of a robot, with the whole paths of its meshes."""
    text = robot.urdf.read_text()
    return _MESH.sub(lambda name: f'filename="{robot.mesh(name[1]).resolve().as_uri()}"', text)
