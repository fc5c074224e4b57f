"""rosbridge clients: the goals and topics of each connection."""

import asyncio
import logging
import uuid
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

import logs
from executive.api.events import Event, Where
from executive.api.joint_state import JointState
from executive.api.outcome import GoalStatus
from executive.api.token_bucket import TokenBucket
from executive.errors import TooMuch, UnknownGoal
from executive.executive import Executive
from executive.server.event_hub import EventHub
from executive.server.limits.cancel_thread import CancelThread
from hardware import Ability, utc_ns

from . import protocol as ros

logger = logging.getLogger(__name__)

MAX_CLIENTS = 16
# Goals per second and at once, of all clients together, because each goal leaves a recording.
GOAL_RATE = (1.0, 60.0)
MAX_SUBSCRIBERS = 1000  # largest number of subscribers of a topic on a connection
MAX_UNSENT = 1000  # largest number of waiting messages for a slow client
_POLICY_VIOLATION, _TRY_LATER = 1008, 1013  # close codes of RFC 6455


class RosbridgeServer:
    """Serves rosbridge clients.

    Args:
        executive: Runs the goals.
        canceler: Cancels goals.
        hub: Source of events.
    """

    def __init__(self, executive: Executive, canceler: CancelThread, hub: EventHub) -> None:
        self.executive, self.canceler = executive, canceler
        self._clients: set[_Client] = set()
        self._joints: tuple[float, JointState] | None = None
        self._measures = executive.robot.can(Ability.MEASURE)
        self._statuses = _GoalStatuses(executive)
        self.goal_bucket = TokenBucket(*GOAL_RATE, executive.clock.now)
        hub.listeners.append(self._handle)

    async def serve(self, websocket: WebSocket) -> None:
        """Serve a connection until it ends. Its goals continue."""
        if len(self._clients) >= MAX_CLIENTS:
            await websocket.close(_TRY_LATER)
            return
        await websocket.accept()
        client = _Client(self, websocket)
        self._clients.add(client)
        try:
            await client.run()
        finally:
            self._clients.discard(client)

    def latest(self, topic: str) -> str:
        """Return the latest message of a topic; empty if there is none."""
        if topic == ros.STATUS:
            return self._statuses.message()
        if self._joints is None:
            return ""
        time, state = self._joints
        return ros.published(topic, ros.joint_state(utc_ns(self.executive.clock, time), state))

    def _handle(self, event: Event) -> None:
        match event:
            case GoalStatus():
                self._statuses.update(event)
                self._for_each(lambda client: client.goal_changed(event))
                self._for_each(lambda client: client.topic_changed(ros.STATUS))
            case logs.Feedback():
                self._for_each(lambda client: client.progressed(event))
            case logs.Measured() | logs.Sent():
                self._publish(event.time, event)
            case logs.Transition(goal="active"):
                self._publish(event.time, self.executive.where())

    def _publish(self, time: float, report: Event | Where) -> None:
        """Publish the state of the joints in a report, if it has one."""
        if state := JointState.of(report, self._measures):
            self._joints = time, state.of_all_joints(self.executive.robot)
            self._for_each(lambda client: client.topic_changed(ros.JOINT_STATES))

    def _for_each(self, act: Callable[["_Client"], None]) -> None:
        for client in tuple(self._clients):
            act(client)


@dataclass(slots=True)
class _Goal:
    """A goal of a client.

    Attributes:
        client_id: Id of the goal from the client.
        feedback: True to send feedback.
        percentage: Last sent percentage; -1 before the first.
    """

    client_id: str
    feedback: bool
    percentage: int = -1


@dataclass(slots=True)
class _Subscription:
    """A topic that a client receives.

    Attributes:
        periods: Shortest time between two messages, by subscriber id [s].
        sent: Time of the last message [s].
        timer: Sends the next message at the end of the period.
    """

    periods: dict[str | None, float] = field(default_factory=dict)
    sent: float = -1e9
    timer: asyncio.TimerHandle | None = None


class _Client:
    """One connection.

    Args:
        bridge: Serves the connection.
        websocket: The connection.
    """

    def __init__(self, bridge: RosbridgeServer, websocket: WebSocket) -> None:
        self._bridge, self._websocket = bridge, websocket
        self._loop = asyncio.get_running_loop()
        self._goals: dict[str, _Goal] = {}  # goals by the executive's goal id
        self._topics: dict[str, _Subscription] = {}
        self._unsent: asyncio.Queue[str] = asyncio.Queue(MAX_UNSENT)
        self._dropped: asyncio.Future[str] = self._loop.create_future()

    async def run(self) -> None:
        """Read and write until the connection ends or the client is dropped."""
        tasks = [self._loop.create_task(act()) for act in (self._receive, self._send)]
        try:
            ends: set[asyncio.Future[Any]] = {*tasks, self._dropped}
            done, _ = await asyncio.wait(ends, return_when=asyncio.FIRST_COMPLETED)
            for each in done - {self._dropped}:
                each.result()
        except WebSocketDisconnect:
            return
        finally:
            for task in tasks:
                task.cancel()
            for subscription in self._topics.values():
                _end_timer(subscription)
            self._topics.clear()
            self._goals.clear()
        with suppress(WebSocketDisconnect):  # the client has left
            await self._websocket.close(_POLICY_VIOLATION, self._dropped.result())

    def goal_changed(self, goal: GoalStatus) -> None:
        """Send the result of a goal that has ended. No more messages about this goal follow."""
        if goal.outcome and (ended := self._goals.pop(goal.identity, None)):
            outcome = goal.outcome
            self._put(ros.result(ended.client_id, outcome.state.value, outcome.success))

    def progressed(self, feedback: logs.Feedback) -> None:
        """Send the progress of a goal. It is 0 % while planning."""
        goal = self._goals.get(feedback.goal_id)
        percentage = feedback.percentage or 0
        if goal and goal.feedback and percentage > goal.percentage:
            goal.percentage = percentage
            self._put(ros.feedback(goal.client_id, percentage))

    def topic_changed(self, topic: str) -> None:
        """Send the latest message of a topic, now or at the end of its period."""
        subscription = self._topics.get(topic)
        if subscription is None or subscription.timer:
            return
        wait = subscription.sent + min(subscription.periods.values()) - self._loop.time()
        if wait > 0:
            subscription.timer = self._loop.call_later(wait, self._publish, topic)
        else:
            self._publish(topic)

    async def _receive(self) -> None:
        while True:
            received = await self._websocket.receive()
            if received["type"] == "websocket.disconnect":
                raise WebSocketDisconnect(received["code"])
            try:
                await self._carry_out(ros.parse(received.get("text")))
            except ros.BadGoal as error:
                self._put(ros.refusal(error.identity or "", str(error)))
            except ros.BadCall as error:
                self._put(ros.service_response(error.call, str(error), done=False))
            except ros.BadMessage as error:
                self._put(ros.error_status(error))

    async def _send(self) -> None:
        while True:
            await self._websocket.send_text(await self._unsent.get())

    async def _carry_out(self, message: ros.Message) -> None:
        match message:
            case ros.SendGoal():
                await self._send_goal(message)
            case ros.CancelGoal():
                await self._cancel(message)
            case ros.CallService():
                await self._call_service(message)
            case ros.Subscribe():
                self._subscribe(message)
            case ros.Unsubscribe():
                self._unsubscribe(message)

    def _subscribe(self, message: ros.Subscribe) -> None:
        topic, identity = message.topic, message.identity
        subscription = self._topics.get(topic) or _Subscription()
        if identity not in subscription.periods and len(subscription.periods) >= MAX_SUBSCRIBERS:
            raise ros.BadMessage(f"{topic} has {MAX_SUBSCRIBERS} subscribers already", identity)
        subscription.periods[identity] = message.period
        self._topics[topic] = subscription
        _end_timer(subscription)
        self._publish(topic)

    def _unsubscribe(self, message: ros.Unsubscribe) -> None:
        subscription = self._topics.get(message.topic)
        if subscription is None:
            return
        subscription.periods.pop(message.identity, None)
        if message.identity is None or not subscription.periods:
            _end_timer(self._topics.pop(message.topic))

    async def _send_goal(self, message: ros.SendGoal) -> None:
        client_id = message.identity
        if any(goal.client_id == client_id for goal in self._goals.values()):
            raise ros.BadMessage(f"the goal {client_id!r} is already under way", client_id)
        if not self._bridge.goal_bucket.take():
            rate, burst = GOAL_RATE
            raise ros.BadGoal(
                f"too many goals: at most {burst:g} at once, then {rate:g} per second "
                f"[{TooMuch.code}]; wait a moment",
                client_id,
            )
        identity = uuid.uuid4().hex
        self._goals[identity] = _Goal(client_id, message.feedback)
        send = partial(self._bridge.executive.send, message.task, identity=identity)
        acceptance = await self._loop.run_in_executor(None, send)
        if not acceptance.accepted:
            self._goals.pop(identity, None)
            self._put(ros.refusal(client_id, f"{acceptance.message} [{acceptance.code}]"))

    async def _cancel(self, message: ros.CancelGoal) -> None:
        for identity, goal in self._goals.items():
            if goal.client_id == message.identity:
                await self._bridge.canceler.cancel(identity, 0)
                return
        raise ros.BadMessage(f"no goal {message.identity!r} is under way", message.identity)

    async def _call_service(self, call: ros.CallService) -> None:
        if call.service != ros.CANCEL_SERVICE:
            raise ros.BadCall(f"no service {call.service}; there is {ros.CANCEL_SERVICE}", call)
        identity, stamp_ns = ros.cancel_request(call)
        answer = await self._bridge.canceler.cancel(identity, stamp_ns)
        stamps = {goal.identity: goal.stamp_ns for goal in self._bridge.executive.goals()}
        canceling = [(each, stamps.get(each, 0)) for each in answer.goals]
        response = ros.cancel_response(answer.code.value, canceling)
        self._put(ros.service_response(call, response, done=True))

    def _publish(self, topic: str) -> None:
        subscription = self._topics[topic]
        subscription.timer, subscription.sent = None, self._loop.time()
        if message := self._bridge.latest(topic):
            self._put(message)

    def _put(self, text: str) -> None:
        try:
            self._unsent.put_nowait(text)
        except asyncio.QueueFull:  # the client reads too slowly; the arm continues
            if not self._dropped.done():
                self._dropped.set_result("too slow")


def _end_timer(subscription: _Subscription) -> None:
    if subscription.timer:
        subscription.timer.cancel()


class _GoalStatuses:
    """The last status of every known goal, in the order of acceptance.

    An event arrives later than the change of the executive, which may already know newer states.

    Args:
        executive: Runs the goals. Its earlier goals are included.
    """

    def __init__(self, executive: Executive) -> None:
        self._executive = executive
        self._statuses: dict[str, str] = {}
        self._ended: deque[str] = deque()
        self._message = ""  # cached until a goal changes
        for goal in executive.goals():
            self.update(goal)

    def update(self, goal: GoalStatus) -> None:
        """Take the new status of a goal."""
        state = goal.state.value
        self._statuses[goal.identity] = ros.goal_status(goal.identity, goal.stamp_ns, state)
        self._message = ""
        if goal.outcome:
            self._ended.append(goal.identity)
        self._forget_ended()

    def message(self) -> str:
        """Return the message of the status topic."""
        self._forget_ended()
        self._message = self._message or ros.status_array(self._statuses.values())
        return self._message

    def _forget_ended(self) -> None:
        """Forget the goals that the executive has forgotten."""
        while self._ended and not self._is_known(self._ended[0]):
            self._statuses.pop(self._ended.popleft(), None)
            self._message = ""

    def _is_known(self, identity: str) -> bool:
        try:
            self._executive.goal(identity)
        except UnknownGoal:
            return False
        return True
