"""Programs of others in ROS 2: stock clients, and rclpy's own servers to compare answers with.

It runs with the Python of ROS 2. It reads one command per line, `["name", argument, ...]`, and
prints its answer as one line of JSON.
"""

import contextlib
import functools
import json
import sys
import threading
import uuid

import rclpy
from action_msgs.msg import GoalInfo, GoalStatusArray
from action_msgs.srv import CancelGoal
from arduinobot_msgs.action import ArduinobotTask
from builtin_interfaces.msg import Time
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetAvailableStates, GetAvailableTransitions, GetState
from rclpy.action import ActionClient, ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn
from rclpy.qos import QoSProfile, qos_profile_action_status_default
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger
from unique_identifier_msgs.msg import UUID

WAIT, NOTHING, FAIL, UNKNOWN = 10, 11, 13, 99
TYPES = ArduinobotTask.Impl
LONGEST = 60.0
RCLError = rclpy_implementation.RCLError


class NoAnswer(Exception):
    pass


class Reference:
    """rclpy's action server, for an arm that does one goal at a time."""

    def __init__(self, node):
        self.busy = False
        ActionServer(
            node,
            ArduinobotTask,
            "reference",
            execute_callback=self.execute,
            goal_callback=self.accept,
            cancel_callback=lambda goal: CancelResponse.ACCEPT,
            callback_group=ReentrantCallbackGroup(),
        )

    def accept(self, goal):
        if self.busy or goal.task_number not in (WAIT, NOTHING, FAIL):
            return GoalResponse.REJECT
        self.busy = True
        return GoalResponse.ACCEPT

    def execute(self, goal):
        canceled = threading.Event()  # never set: the goal is asked
        while goal.request.task_number == WAIT and not goal.is_cancel_requested:
            canceled.wait(0.01)
        if goal.is_cancel_requested:
            goal.canceled()
        elif goal.request.task_number == FAIL:
            goal.abort()
        else:
            goal.succeed()
        self.busy = False
        return ArduinobotTask.Result(success=goal.request.task_number == NOTHING)


class ReferenceLifecycle(LifecycleNode):
    """rclpy's lifecycle node. That of Jazzy raises where that of Kilted answers "not possible"."""

    def _LifecycleNodeMixin__change_state(self, transition_id):  # noqa: N802
        try:
            return super()._LifecycleNodeMixin__change_state(transition_id)
        except RCLError:
            return TransitionCallbackReturn.FAILURE


class Action:
    """Raw clients of an action: what a client may send beside what rclpy sends."""

    def __init__(self, node, name):
        self.clients = {
            kind: node.create_client(kind, f"{name}/_action/{part}")
            for kind, part in (
                (TYPES.SendGoalService, "send_goal"),
                (TYPES.GetResultService, "get_result"),
                (CancelGoal, "cancel_goal"),
            )
        }
        self.node, self.name, self.changed = node, name, threading.Condition()
        self.histories = {}
        self.subscribe(self.listen)

    def subscribe(self, act):
        name, qos = f"{self.name}/_action/status", qos_profile_action_status_default
        return self.node.create_subscription(
            GoalStatusArray,
            name,
            act,
            QoSProfile(depth=50, durability=qos.durability, reliability=qos.reliability),
        )

    def listen(self, message):
        with self.changed:
            for each in message.status_list:
                history = self.histories.setdefault(bytes(each.goal_info.goal_id.uuid), [])
                if not history or history[-1] != each.status:
                    history.append(each.status)
            self.changed.notify_all()

    def call(self, kind, request):
        assert self.clients[kind].wait_for_service(LONGEST)
        return self.clients[kind].call_async(request)

    def send(self, task, identity=None, longest=LONGEST):
        goal = UUID(uuid=list(identity if identity is not None else uuid.uuid4().bytes))
        request = TYPES.SendGoalService.Request(goal_id=goal)
        request.goal.task_number = task
        answer = got(self.call(TYPES.SendGoalService, request), longest)
        return goal, answer.accepted, answer.stamp

    def result(self, goal):
        return self.call(TYPES.GetResultService, TYPES.GetResultService.Request(goal_id=goal))

    def cancel(self, goal=None, stamp=None):
        info = GoalInfo(goal_id=goal or UUID(), stamp=stamp or Time())
        answer = got(self.call(CancelGoal, CancelGoal.Request(goal_info=info)))
        return answer.return_code, [bytes(each.goal_id.uuid) for each in answer.goals_canceling]

    def until(self, goal, status):
        """Wait until a goal has a status, and had no later one; the topic may leave some out."""
        key = bytes(goal.uuid)
        with self.changed:
            assert self.changed.wait_for(lambda: status in self.histories.get(key, ()), LONGEST)
            assert self.histories[key] == sorted(self.histories[key])

    def ended(self, goal):
        answer = got(self.result(goal))
        self.until(goal, answer.status)
        return answer.status, answer.result.success

    def rows(self):
        """Ask everything; return the answers by question."""
        rows = {}
        goal, accepted, stamp = self.send(NOTHING)
        rows["a good goal"] = accepted, stamp.sec > 0, *self.ended(goal)
        rows["its result again"] = got(self.result(goal)).status
        _, accepted, stamp = self.send(NOTHING, goal.uuid)
        rows["the same id again"] = accepted, stamp.sec, stamp.nanosec
        rows["cancel a goal that ended"] = self.cancel(goal)
        rows["cancel an unknown goal"] = self.cancel(UUID(uuid=list(range(16))))
        rows["cancel all, none active"] = self.cancel()
        answer = got(self.result(UUID(uuid=list(range(16)))))
        rows["the result of an unknown goal"] = answer.status, answer.result.success
        _, accepted, stamp = self.send(UNKNOWN)
        rows["an unknown task"] = accepted, stamp.sec, stamp.nanosec
        rows["a negative task"] = self.send(-1)[1]
        goal, accepted, _ = self.send(FAIL)
        rows["a goal that fails"] = accepted, *self.ended(goal)
        for name in ("one", "all", "until"):
            goal, accepted, stamp = self.send(WAIT)
            self.until(goal, 2)
            waiting = [self.result(goal), self.result(goal)]
            rows[f"a second goal ({name})"] = self.send(NOTHING)[1]
            stamp.sec += 1
            asked = {"one": {"goal": goal}, "all": {}, "until": {"stamp": stamp}}[name]
            code, canceling = self.cancel(**asked)
            rows[f"cancel {name}"] = accepted, code, canceling == [bytes(goal.uuid)]
            rows[f"two results ({name})"] = [got(each).status for each in waiting]
            rows[f"canceled ({name})"] = self.ended(goal)
        rows["cancel before its time"] = self.early()
        goal, accepted, _ = self.send(NOTHING, bytes(16))
        rows["an id of zeros"] = accepted, *self.ended(goal)
        late, seen = threading.Event(), []
        self.subscribe(lambda message: (seen.append(message), late.set()))
        assert late.wait(LONGEST)
        rows["a late subscriber"] = sorted(each.status for each in seen[0].status_list)
        return rows

    def early(self):
        goal, _, stamp = self.send(WAIT)
        stamp.sec -= 5
        return self.cancel(stamp=stamp), self.cancel(goal)[0], got(self.result(goal)).status


class Lifecycle:
    """A client of a lifecycle node."""

    def __init__(self, node, name):
        kinds = {
            "change_state": ChangeState,
            "get_state": GetState,
            "get_available_states": GetAvailableStates,
            "get_available_transitions": GetAvailableTransitions,
            "get_transition_graph": GetAvailableTransitions,
        }
        self.clients = {
            each: node.create_client(kind, f"{name}/{each}") for each, kind in kinds.items()
        }

    def ask(self, name, **fields):
        client = self.clients[name]
        assert client.wait_for_service(LONGEST)
        return got(client.call_async(client.srv_type.Request(**fields)))

    def state(self):
        state = self.ask("get_state").current_state
        found = self.ask("get_available_transitions").available_transitions
        return state.id, state.label, sorted(map(described, found))

    def rows(self):
        """Take it from *unconfigured* to *active*, with detours; return the answers."""
        states = self.ask("get_available_states").available_states
        graph = self.ask("get_transition_graph").available_transitions
        rows = {
            "states": sorted((each.id, each.label) for each in states),
            "graph": sorted(map(described, graph)),
            "at first": self.state(),
        }
        for wanted in (
            Transition(id=3),  # not from here
            Transition(id=1),
            Transition(label="cleanup"),
            Transition(label="nonsense"),
            Transition(id=1),
            Transition(id=250, label="activate"),
            Transition(id=1),
            Transition(id=4),
            Transition(id=3),
        ):
            success = self.ask("change_state", transition=wanted).success
            rows[f"{len(rows)}: {wanted.id} {wanted.label}"] = success, self.state()
        return rows


def described(each):
    return each.transition.id, each.transition.label, each.start_state.label, each.goal_state.label


def got(future, longest=LONGEST):
    done = threading.Event()
    future.add_done_callback(lambda _: done.set())
    if not done.wait(longest):
        raise NoAnswer
    return future.result()


def repeated(ask):
    """Ask until an answer comes: a node that was killed stays known for a while, and is asked."""
    while True:
        with contextlib.suppress(NoAnswer):
            return ask()


class Peer:
    def __init__(self):
        self.node = rclpy.create_node("peer")
        self.reference = Reference(self.node)
        self.lifecycle_node = ReferenceLifecycle("lifecycle_reference")
        self.actions, self.parked = {}, None
        self.stock = ActionClient(self.node, ArduinobotTask, "task_server")
        self.original = ActionClient(rclpy.create_node("original"), ArduinobotTask, "task_server")
        self.executor = MultiThreadedExecutor(8)
        self.executor.add_node(self.node)
        self.executor.add_node(self.lifecycle_node)
        self.spinning = threading.Thread(target=self.executor.spin, daemon=True)
        self.spinning.start()

    def close(self):
        """End the threads of the executor, which abort the program if they outlive it."""
        self.executor.shutdown()
        self.spinning.join(LONGEST)
        rclpy.shutdown()

    def action(self, name):
        return self.actions.setdefault(name, Action(self.node, name))

    def rows(self, name):
        return self.action(name).rows()

    def lifecycle(self, name):
        return Lifecycle(self.node, name).rows()

    def stock_client(self, task):
        """What everybody writes: send, feedback, result."""
        assert self.stock.wait_for_server(LONGEST)
        feedback = []
        goal = got(
            self.stock.send_goal_async(
                ArduinobotTask.Goal(task_number=task),
                feedback_callback=lambda message: feedback.append(message.feedback.percentage),
            )
        )
        result = got(goal.get_result_async())
        return goal.accepted, result.status, result.result.success, feedback

    def original_client(self, task):
        """What the original's voice interface does: send and forget. Its node is never spun."""
        goal = ArduinobotTask.Goal()
        goal.task_number = task
        self.original.send_goal_async(goal)

    def type_hash(self):
        """The hash of the type that the node publishes feedback with."""
        (info,) = self.node.get_publishers_info_by_topic("/task_server/_action/feedback")
        return str(info.topic_type_hash)

    def start(self, space, task):
        """Send a goal until it is accepted, and ask for its result, which `wait` returns."""
        action, accepted = self.action(f"{space}/task_server"), False
        identity = uuid.uuid4().bytes
        # The node may not have found the server yet, or its answer may come too late.
        while not (accepted or identity in action.histories):
            goal, accepted, _ = repeated(lambda: action.send(task, identity, longest=1))
        action.until(goal, 2)
        self.parked = action.result(goal)
        return bytes(goal.uuid).hex()

    def wait(self):
        return got(self.parked).status

    def rejected(self, space, task):
        return not self.action(f"{space}/task_server").send(task)[1]

    def result_of(self, identity):
        action, goal = self.action("/task_server"), UUID(uuid=list(bytes.fromhex(identity)))
        return repeated(lambda: got(action.result(goal), longest=1)).status

    def cancel(self, space):
        return self.action(f"{space}/task_server").cancel()

    def trigger(self, space, name):
        client = self.node.create_client(Trigger, f"{space}/armtree/{name}")
        assert client.wait_for_service(LONGEST), name
        answer = got(client.call_async(Trigger.Request()))
        return answer.success, answer.message

    def until_unknown(self, space):
        node = Lifecycle(self.node, f"{space}/armtree")
        while node.ask("get_state").current_state.label != "unknown":
            pass
        return True

    def topics(self):
        """One message of each topic about the arm."""
        found, done = {}, threading.Event()

        def take(name, message):
            found.setdefault(name, message)
            if len(found) == 2:
                done.set()

        for kind, name, qos in (
            (JointState, "/joint_states", 10),
            (String, "/robot_description", qos_profile_action_status_default),
        ):
            self.node.create_subscription(kind, name, functools.partial(take, name), qos)
        assert done.wait(LONGEST), found.keys()
        joints = found["/joint_states"]
        return (
            list(joints.name),
            list(joints.position),
            joints.header.frame_id,
            found["/robot_description"].data,
        )


def main():
    rclpy.init()
    peer = Peer()
    for line in sys.stdin:
        name, *arguments = json.loads(line)
        sys.stdout.write(json.dumps(getattr(peer, name)(*arguments)) + "\n")
        sys.stdout.flush()
    peer.close()


if __name__ == "__main__":
    main()
