"""The node: services that may answer later, publishers, and the thread that receives requests."""

import asyncio
import logging
from collections.abc import Awaitable, Callable, Sequence
from typing import Any, Self

import rclpy
import rclpy.utilities
from rclpy.exceptions import NameValidationException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions

logger = logging.getLogger(__name__)

NAME = "armtree"

Answer = Callable[[Any, Any], Awaitable[None]]
_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_FRESH = QoSProfile(depth=10)


class BadRosArguments(Exception):
    """ROS refuses its arguments."""


class Node:
    """A node of ROS 2 for a program that uses asyncio. Use it as an asynchronous context.

    Args:
        arguments: Arguments for ROS, such as `--ros-args -r __ns:=/left`.

    Raises:
        BadRosArguments: ROS refuses its arguments.

    Attributes:
        log: Logger of the node, which also publishes to `/rosout`.
        spinning: Task of the thread that receives requests.
    """

    def __init__(self, arguments: Sequence[str] = ()) -> None:
        self._context, options = rclpy.Context(), SignalHandlerOptions.NO
        try:
            rclpy.init(
                args=[NAME, *arguments], context=self._context, signal_handler_options=options
            )
            self._node = rclpy.create_node(NAME, context=self._context)
            unknown = rclpy.utilities.remove_ros_args([NAME, *arguments])[1:]
        except (RuntimeError, NameValidationException) as error:
            raise BadRosArguments(str(error).splitlines()[0]) from error
        if unknown:
            raise BadRosArguments(f"put {' '.join(unknown)} between --ros-args and --")
        self._loop = asyncio.get_running_loop()
        self._executor = SingleThreadedExecutor(context=self._context)
        self._answering = set[asyncio.Task[None]]()
        self.log: Any = self._node.get_logger()

    async def __aenter__(self) -> Self:
        self._executor.add_node(self._node)
        self.spinning = asyncio.create_task(asyncio.to_thread(self._spin))
        return self

    async def __aexit__(self, *raised: object) -> None:
        self._executor.shutdown(timeout_sec=0)
        self._context.try_shutdown()
        await self.spinning
        for task in self._answering:
            task.cancel()
        self._node.destroy_node()

    def now(self) -> Any:
        """Return the time as a message."""
        return self._node.get_clock().now().to_msg()

    def publisher(self, kind: Any, name: str, latched: bool = False) -> Callable[[Any], None]:
        """Return a function that publishes a message.

        Args:
            kind: Type of the messages.
            name: Name of the topic.
            latched: True if a late subscriber gets the last message.
        """
        publisher = self._node.create_publisher(kind, name, _LATCHED if latched else _FRESH)
        return lambda message: publisher.publish(message) if self._context.ok() else None

    def serve(self, kind: Any, name: str, answer: Answer) -> Callable[[], object]:
        """Offer a service.

        Args:
            kind: Type of the service.
            name: Name of the service.
            answer: Callback that fills the response to a request. It runs in the event loop, and
                may take long.

        Returns:
            A function that withdraws the service.
        """
        service = self._node.create_service(kind, name, lambda *pair: pair)
        respond = service.send_response

        async def fill(request: Any, response: Any, header: Any) -> None:
            try:
                await answer(request, response)
            except Exception:  # catches every error of a request; the response is then a failure
                logger.exception("a bug in armtree")
                self.log.error("a bug in armtree; armtree ros2 --verbose shows where")
            if self._context.ok():
                respond(response, header)

        def start(pair: tuple[Any, Any], header: Any) -> None:
            task = self._loop.create_task(fill(pair[0], pair[1], header))
            self._answering.add(task)
            task.add_done_callback(self._answering.discard)

        # The executor of rclpy passes the result of the callback to `send_response` at once.
        service.send_response = lambda pair, header: self._loop.call_soon_threadsafe(
            start, pair, header
        )
        # On the executor's thread, because elsewhere the executor could wait for the service.
        return lambda: self._executor.create_task(self._node.destroy_service, service)

    def _spin(self) -> None:
        try:
            self._executor.spin()
        except ExternalShutdownException:
            return
