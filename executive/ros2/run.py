"""Runs the node."""

import asyncio
import signal
from collections.abc import Sequence

from hardware import Robot

from .bridge import Bridge
from .joints import Joints
from .lifecycle import HardwareLifecycle
from .node import Node
from .triggers import Triggers

_NO_ACTION = (
    "this ROS 2 lacks the package arduinobot_msgs, so there is no action task_server; build "
    "executive/ros2/arduinobot_msgs: see the page *ROS 2*. The services ~/run_NAME work without it"
)


async def run(url: str, robot: Robot, arguments: Sequence[str] = ()) -> int:
    """Run the node until Ctrl-C or SIGTERM. Then cancel the goals that it sent.

    Args:
        url: URL of the server of the arm.
        robot: Robot of the arm.
        arguments: Arguments for ROS.

    Returns:
        Number of the signal that ended the run.
    """
    signals, loop = asyncio.Queue[int](), asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, signals.put_nowait, number)
    async with Node(arguments) as node, Bridge(url, robot, node.log) as bridge:
        _serve_action(node, bridge)
        HardwareLifecycle(node, bridge)
        Triggers(node, bridge)
        parts = (bridge.run(), bridge.follow_tasks(), Joints(node, bridge).run())
        signal_read = asyncio.ensure_future(signals.get())
        tasks = [node.spinning, signal_read, *map(asyncio.ensure_future, parts)]
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                task.result()  # raises the errors of bugs
            await bridge.end()
            return signal_read.result()
        finally:
            for task in tasks[1:]:
                task.cancel()


def _serve_action(node: Node, bridge: Bridge) -> None:
    try:
        from .task_server import TaskServer
    except ModuleNotFoundError as error:
        if error.name != "arduinobot_msgs":
            raise
        node.log.warning(_NO_ACTION)
    else:
        TaskServer(node, bridge)
