"""A client as written for the original robot, with roslibpy: tells in JSON what came of it."""

import json
import os
import sys
import threading
from typing import Any

import roslibpy  # type: ignore[import-untyped]


class Goal:
    """One goal, and what came of it."""

    def __init__(self, client: roslibpy.ActionClient, task: int, until: str = "result") -> None:
        self.reported: dict[str, Any] = {"feedback": [], "end": None}
        self._events = {"result": threading.Event(), "feedback": threading.Event()}
        self.identity = client.send_goal(
            roslibpy.Goal({"task_number": task}), self._done, self._feedback, self._refused
        )
        self.wait(until)

    def wait(self, until: str = "result") -> dict[str, Any]:
        """What came, once there is something of that kind."""
        if not self._events[until].wait(20):
            raise TimeoutError(until)
        return self.reported

    def _done(self, result: Any) -> None:
        end = {"kind": "result", "status": result["status"].value, "values": result["values"]}
        self.reported["end"] = end
        self._events["result"].set()

    def _feedback(self, feedback: Any) -> None:
        self.reported["feedback"].append(feedback["percentage"])
        self._events["feedback"].set()

    def _refused(self, error: Any) -> None:
        self.reported["end"] = {"kind": "error", "values": error["values"]}
        self._events["result"].set()


def first(ros: roslibpy.Ros, topic: str, kind: str) -> dict[str, Any]:
    """The first message on a topic."""
    came: list[dict[str, Any]] = []
    some = threading.Event()

    def hear(message: Any) -> None:
        came.append(dict(message))
        some.set()

    listener = roslibpy.Topic(ros, topic, kind)
    listener.subscribe(hear)
    if not some.wait(20):
        raise TimeoutError(topic)
    listener.unsubscribe()
    return came[0]


def main(port: int) -> None:
    """Go through all that such a client may do."""
    ros = roslibpy.Ros("127.0.0.1", port)
    ros.run(20)
    kind = "arduinobot_msgs/action/ArduinobotTask"
    client = roslibpy.ActionClient(ros, "/task_server", kind)
    reported: dict[str, Any] = {
        "moved": Goal(client, 1).reported,
        "failed": Goal(client, 99).reported,
    }
    waiting = Goal(client, 10, "feedback")
    reported["busy"] = Goal(client, 11).reported
    client.cancel_goal(waiting.identity)
    reported["canceled"] = waiting.wait()
    moving = Goal(client, 0, "feedback")
    client.cancel_goal(moving.identity)
    reported["stopped"] = moving.wait()
    other = roslibpy.ActionClient(ros, "/task_server", "arduinobot_msgs/action/Other")
    reported["other"] = Goal(other, 1).reported
    reported["many"] = [Goal(client, 11).reported["end"]["values"] for _ in range(50)]
    reported["joints"] = first(ros, "/joint_states", "sensor_msgs/JointState")
    reported["status"] = first(ros, "/task_server/_action/status", "action_msgs/GoalStatusArray")
    sys.stdout.write(json.dumps(reported) + "\n")
    sys.stdout.flush()
    os._exit(0)  # how its reactor's thread ends is not what is tried here


main(int(sys.argv[1]))
