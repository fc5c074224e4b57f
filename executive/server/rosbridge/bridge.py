"""rosbridge clients: each connection's goals and topics, on top of the executive."""

import asyncio
import logging
import uuid
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

import logs
from executive.executive import Event, Executive
from executive.goals.goal import GoalStatus
from executive.server.event_hub import EventHub
from executive.server.limits.cancel_thread import CancelThread
from hardware import Clock, Robot, state_interfaces

from . import protocol as ros
from .statuses import Statuses

logger = logging.getLogger(__name__)

MAX_CLIENTS = 16
MAX_SUBSCRIBERS = 1000  # of one topic, on one connection
MAX_UNSENT = 1000  # messages that a client may be behind
_POLICY_VIOLATION, _TRY_LATER = 1008, 1013  # close codes of RFC 6455


class Bridge:
    """Serves rosbridge clients.

    Args:
        executive: Which.
        stops: What cancels its goals.
        hub: Where its events arrive.
        robot: Whose joints.
        clock: Whose time.
    """

    def __init__(
        self, executive: Executive, stops: CancelThread, hub: EventHub, robot: Robot, clock: Clock
    ) -> None:
        self.executive, self.stops = executive, stops
        self.robot, self.clock = robot, clock
        self._clients: set[_Client] = set()
        self._joints: tuple[float, Mapping[str, float]] | None = None
        self._statuses = Statuses(executive)
        hub.listeners.append(self._tell)

    async def serve(self, websocket: WebSocket) -> None:
        """Serve a connection until it ends. Its goals go on without it."""
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

    def now(self, topic: str) -> str:
        """The message that a topic has now; empty where it has none."""
        if topic == ros.STATUS:
            return self._statuses.message()
        if self._joints is None:
            return ""
        time, positions = self._joints
        utc_ns = self.clock.epoch_ns() + round(time * 1e9)
        return ros.published(topic, ros.joint_state(utc_ns, positions))

    def _tell(self, event: Event) -> None:
        match event:
            case GoalStatus():
                self._statuses.note(event)
                self._each(lambda client: client.goal_changed(event))
                self._each(lambda client: client.published(ros.STATUS))
            case logs.Feedback():
                self._each(lambda client: client.progressed(event))
            case logs.Sent() if event.joints:
                self._stands(event.time, dict(zip(event.joints, event.positions, strict=True)))
            case logs.Transition(goal="active"):
                self._stands(event.time, self.executive.snapshot().commanded)

    def _stands(self, time: float, commanded: Mapping[str, float] | None) -> None:
        if commanded is None:
            return
        actuated = [commanded[joint.name] for joint in self.robot.actuated]
        interfaces = state_interfaces(self.robot, actuated)
        self._joints = time, {name.partition("/")[0]: q for name, q in interfaces.items()}
        self._each(lambda client: client.published(ros.JOINT_STATES))

    def _each(self, act: Callable[["_Client"], None]) -> None:
        for client in tuple(self._clients):
            act(client)


@dataclass(slots=True)
class _Goal:
    """A goal of a client.

    Attributes:
        theirs: What the client calls it.
        feedback: Whether the client wants to hear of it.
        percentage: What it heard last.
    """

    theirs: str
    feedback: bool
    percentage: int = -1


@dataclass(slots=True)
class _Subscription:
    """A topic that a client hears of.

    Attributes:
        throttles: How seldom each of its subscribers, by id, is content to hear [s].
        told: When it heard last [s].
        later: When it will, where that was too short ago.
    """

    throttles: dict[str | None, float] = field(default_factory=dict)
    told: float = -1e9
    later: asyncio.TimerHandle | None = None


class _Client:
    """One connection.

    Args:
        bridge: Whose.
        websocket: The connection.
    """

    def __init__(self, bridge: Bridge, websocket: WebSocket) -> None:
        self._bridge, self._websocket = bridge, websocket
        self._loop = asyncio.get_running_loop()
        self._goals: dict[str, _Goal] = {}  # by our identity
        self._topics: dict[str, _Subscription] = {}
        self._unsent: asyncio.Queue[str] = asyncio.Queue(MAX_UNSENT)
        self._sent_away: asyncio.Future[str] = self._loop.create_future()

    async def run(self) -> None:
        """Read and write until either ends, or the client is sent away."""
        both = [self._loop.create_task(act()) for act in (self._receive, self._send)]
        try:
            ends: set[asyncio.Future[Any]] = {*both, self._sent_away}
            done, _ = await asyncio.wait(ends, return_when=asyncio.FIRST_COMPLETED)
            for each in done - {self._sent_away}:
                each.result()
        except WebSocketDisconnect:
            return
        finally:
            for each in both:
                each.cancel()
            for topic in self._topics.values():
                _forget(topic)
            self._topics.clear()
            self._goals.clear()
        with suppress(WebSocketDisconnect):  # it is gone by itself
            await self._websocket.close(_POLICY_VIOLATION, self._sent_away.result())

    def goal_changed(self, goal: GoalStatus) -> None:
        """Tell of the end of a goal; once, and nothing of it after that."""
        if goal.outcome and (ours := self._goals.pop(goal.identity, None)):
            outcome = goal.outcome
            self._put(ros.result(ours.theirs, outcome.state.value, outcome.success))

    def progressed(self, feedback: logs.Feedback) -> None:
        """Tell how far a goal is; planning has no number, so it is 0."""
        ours = self._goals.get(feedback.goal_id)
        percentage = feedback.percentage or 0
        if ours and ours.feedback and percentage > ours.percentage:
            ours.percentage = percentage
            self._put(ros.feedback(ours.theirs, percentage))

    def published(self, topic: str) -> None:
        """Tell of a topic that has something new, now or when it may be told."""
        subscription = self._topics.get(topic)
        if subscription is None or subscription.later:
            return
        wait = subscription.told + min(subscription.throttles.values()) - self._loop.time()
        if wait > 0:
            subscription.later = self._loop.call_later(wait, self._publish, topic)
        else:
            self._publish(topic)

    async def _receive(self) -> None:
        while True:
            received = await self._websocket.receive()
            if received["type"] == "websocket.disconnect":
                raise WebSocketDisconnect(received["code"])
            try:
                await self._obey(ros.parse(received.get("text")))
            except ros.BadGoal as error:
                self._put(ros.refusal(error.identity or "", str(error)))
            except ros.BadCall as error:
                self._put(ros.service_response(error.call, str(error), done=False))
            except ros.BadMessage as error:
                self._put(ros.complaint(error))

    async def _send(self) -> None:
        while True:
            await self._websocket.send_text(await self._unsent.get())

    async def _obey(self, message: ros.Message) -> None:
        match message:
            case ros.SendGoal():
                await self._begin(message)
            case ros.CancelGoal():
                await self._cancel(message)
            case ros.CallService():
                await self._serve(message)
            case ros.Subscribe():
                self._subscribe(message)
            case ros.Unsubscribe():
                self._unsubscribe(message)

    def _subscribe(self, message: ros.Subscribe) -> None:
        topic, identity = self._topics.get(message.topic) or _Subscription(), message.identity
        if identity not in topic.throttles and len(topic.throttles) >= MAX_SUBSCRIBERS:
            raise ros.BadMessage(
                f"{message.topic} has {MAX_SUBSCRIBERS} subscribers here already", identity
            )
        topic.throttles[identity] = message.throttle
        self._topics[message.topic] = topic
        _forget(topic)
        self._publish(message.topic)

    def _unsubscribe(self, message: ros.Unsubscribe) -> None:
        topic = self._topics.get(message.topic)
        if topic is None:
            return
        topic.throttles.pop(message.identity, None)
        if message.identity is None or not topic.throttles:
            _forget(self._topics.pop(message.topic))

    async def _begin(self, message: ros.SendGoal) -> None:
        theirs = message.identity
        if any(goal.theirs == theirs for goal in self._goals.values()):
            raise ros.BadMessage(f"there is a goal {theirs!r} already", theirs)
        identity = uuid.uuid4().hex
        self._goals[identity] = _Goal(theirs, message.feedback)
        send = partial(self._bridge.executive.send, message.task, identity=identity)
        acceptance = await self._loop.run_in_executor(None, send)
        if not acceptance.accepted:
            self._goals.pop(identity, None)
            self._put(ros.refusal(theirs, f"{acceptance.message} [{acceptance.code}]"))

    async def _cancel(self, message: ros.CancelGoal) -> None:
        for identity, goal in self._goals.items():
            if goal.theirs == message.identity:
                await self._bridge.stops.cancel(identity, 0)
                return
        raise ros.BadMessage(f"no goal {message.identity!r} is under way", message.identity)

    async def _serve(self, call: ros.CallService) -> None:
        if call.service != ros.CANCEL_SERVICE:
            raise ros.BadCall(f"no service {call.service}; there is {ros.CANCEL_SERVICE}", call)
        identity, stamp_ns = ros.cancel_request(call)
        answer = await self._bridge.stops.cancel(identity, stamp_ns)
        stamps = {goal.identity: goal.stamp_ns for goal in self._bridge.executive.goals()}
        canceling = [(each, stamps.get(each, 0)) for each in answer.goals]
        response = ros.cancel_response(answer.code.value, canceling)
        self._put(ros.service_response(call, response, done=True))

    def _publish(self, topic: str) -> None:
        subscription = self._topics[topic]
        subscription.later, subscription.told = None, self._loop.time()
        if message := self._bridge.now(topic):
            self._put(message)

    def _put(self, text: str) -> None:
        try:
            self._unsent.put_nowait(text)
        except asyncio.QueueFull:  # it reads too slowly; the arm goes on
            self._send_away("too slow")

    def _send_away(self, why: str) -> None:
        if not self._sent_away.done():
            self._sent_away.set_result(why)


def _forget(subscription: _Subscription) -> None:
    if subscription.later:
        subscription.later.cancel()
