"""Stock programs of ROS 2 use `armtree ros2`, and get the answers that rclpy's own servers give."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from executive.api import Policy
from executive.api.joint_state import JointState
from executive.api.outcome import GoalState
from executive.ros2 import installation
from hardware import RealClock, Robot
from skills.motion import Pool
from tests.support.paths import PEERS
from tests.support.servers.serving import Served

pytest_plugins = ["tests.support.servers.server_fixtures"]
pytestmark = pytest.mark.slow

LONGEST = 30.0  # [s]
FOLDER = Path(os.environ.get("ROS2_OF_TESTS", installation.FOLDER))  # see `make jazzy`
# Of the original's ArduinobotTask_FeedbackMessage, by rosidl.
FEEDBACK_HASH = "09bf0add97e07397fc80e2eb07a76c0070cdcc3370e4761f94023fcf7d3a5f4d"

Process = subprocess.Popen[str]
Start = Callable[..., Process]  # starts Python with words


class Peer:
    """The program with the stock clients."""

    def __init__(self, process: Process) -> None:
        self.process = process

    def ask(self, *words: Any) -> Any:
        self.put(*words)
        return self.get()

    def put(self, *words: Any) -> None:
        assert self.process.stdin
        self.process.stdin.write(json.dumps(words) + "\n")
        self.process.stdin.flush()

    def get(self) -> Any:
        assert self.process.stdout
        return json.loads(self.process.stdout.readline())


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, str]:
    """The environment of the programs: no other program of ROS hears them."""
    found = installation.environment(FOLDER)
    if found is None:
        pytest.skip(f"ROS 2 is not installed in {FOLDER}: make ros2")
    folder = str(tmp_path_factory.mktemp("ros2"))
    # A domain of this process: in that of another run, Fast DDS meets what its killed programs left
    # in shared memory, and then may not find a service (ros2/rmw_fastrtps#699).
    own = {"ROS_DOMAIN_ID": str(1 + os.getpid() % 100), installation.DISCOVERY: "LOCALHOST"}
    return {**found, **own, "ROS_LOG_DIR": folder, "XDG_RUNTIME_DIR": folder}


@pytest.fixture(scope="module")
def start(environment: Mapping[str, str]) -> Iterator[Start]:
    """Starts programs, which end with the module."""
    with ExitStack() as stack:

        def start(*words: str, **options: Any) -> Process:
            process = subprocess.Popen(
                [sys.executable, *words], env=environment, text=True, **options
            )
            stack.enter_context(ended(process))
            return process

        yield start


@contextmanager
def ended(process: Process) -> Iterator[None]:
    with process:
        yield
        process.kill()


@pytest.fixture(scope="module")
def served(
    environment: Mapping[str, str], quick_robot: Robot, real_pool: Pool, real_clock: RealClock
) -> Iterator[Served]:
    with pytest.MonkeyPatch.context() as patch:
        folder = Path(environment["XDG_RUNTIME_DIR"])
        patch.setenv("XDG_RUNTIME_DIR", str(folder))
        served = Served(quick_robot, real_pool, folder, real_clock)
        served.start(Policy.REJECT, active=True)
        yield served
        served.stop()


@pytest.fixture(scope="module")
def peer(start: Start) -> Peer:
    return new_peer(start)


def new_peer(start: Start) -> Peer:
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    return Peer(start(str(PEERS / "ros2_peer.py"), **pipes))


@pytest.fixture(scope="module")
def node(start: Start, served: Served, peer: Peer) -> Process:
    return start("-m", "armtree", "ros2", "--server", served.server.url)


def test_the_interface_package_builds(environment: Mapping[str, str], tmp_path: Path) -> None:
    """With the two commands that colcon uses for a package of this kind."""
    if not shutil.which("cmake"):
        pytest.skip("cmake is not installed")
    package, made = Path(installation.__file__).with_name("arduinobot_msgs"), tmp_path / "install"
    options = [f"-DCMAKE_INSTALL_PREFIX={made}", f"-DCMAKE_PREFIX_PATH={FOLDER}"]
    options += [f"-DPython3_EXECUTABLE={sys.executable}", "-DBUILD_TESTING=OFF"]
    configure = ["-S", str(package), "-B", str(tmp_path), *options]
    for words in (configure, ["--build", str(tmp_path), "-t", "install"]):
        subprocess.run(["cmake", *words], env=environment, check=True, capture_output=True)
    assert (made / "share/arduinobot_msgs/package.xml").is_file()
    module = next(made.glob("lib/python*/site-packages/arduinobot_msgs/action/_arduinobot_task.py"))
    assert "class ArduinobotTask" in module.read_text()


def test_the_answers_are_those_of_rclpy(served: Served, node: object, peer: Peer) -> None:
    reference = peer.ask("rows", "/reference")
    assert peer.ask("rows", "/task_server") == reference
    nothing = (served.tasks / "11_nothing.yaml").read_text()
    later = nothing.replace("11", "15").replace("name: nothing", "name: later")
    (served.tasks / "15_later.yaml").write_text(later)  # for a later test
    assert reference["a good goal"] == [True, True, 4, True]


def test_the_hardware_is_a_lifecycle_node(served: Served, node: object, peer: Peer) -> None:
    served.executive.arm_to("deactivate")
    served.executive.arm_to("cleanup")
    reference = peer.ask("lifecycle", "/lifecycle_reference")
    assert peer.ask("lifecycle", "/armtree") == reference
    assert served.executive.status().arm == "active"


def test_a_stock_client_the_topics_and_the_triggers(
    served: Served, node: object, peer: Peer, start: Start
) -> None:
    accepted, status, success, feedback = peer.ask("stock_client", 0)
    assert (accepted, status, success) == (True, 4, True)
    assert feedback == sorted(set(feedback))
    assert FEEDBACK_HASH in peer.ask("type_hash")
    names, positions, kind, urdf = peer.ask("topics")
    commanded = served.executive.where().commanded
    assert commanded
    expected = JointState(False, commanded).of_all_joints(served.robot).position
    assert (dict(zip(names, positions, strict=True)), kind) == (expected, "commanded")
    assert {each.get("name") for each in ElementTree.fromstring(urdf).iter("joint")} >= {*names}
    assert peer.ask("trigger", "", "run_nothing")[0]
    # The programs of Fast DDS that know the node sometimes never hear of its new service.
    assert new_peer(start).ask("trigger", "", "run_later")[0]
    success, message = peer.ask("trigger", "", "run_fail")
    assert not success
    assert "[task.failed" in message
    peer.ask("start", "", 10)
    assert peer.ask("trigger", "", "stop") == [True, "stopped; canceled goals: 1"]
    assert peer.ask("wait") == 5


def test_the_calls_of_the_original_client_run_a_task(
    served: Served, node: object, peer: Peer
) -> None:
    for task in (0, 11):
        assert peer.ask("stock_client", 11)[1] == 4  # its answer shows that the node is known
        before = len(served.executive.goals())
        peer.ask("original_client", task)
        while len(served.executive.goals()) == before:
            continue
        goal = served.executive.goals()[-1]
        assert goal.task == task
        assert served.executive.result(goal.identity, LONGEST).state is GoalState.SUCCEEDED


def test_goals_end_with_the_node_and_with_the_server(
    served: Served, node: Process, peer: Peer, start: Start
) -> None:
    files = {"robot": served.robot.path, "trees": served.tasks, "recordings": served.folder / "2"}
    words = [word for name, path in files.items() for word in (f"--{name}", str(path))]

    def serve(port: str) -> Process:
        command = ("serve", "--tcp-port", port, "--port", "virtual", "--activate", *words)
        return start("-m", "armtree", *command, stderr=subprocess.PIPE)

    def ready(server: Process) -> str:
        log = ""
        assert server.stderr
        while "ready to take commands" not in log:
            log += server.stderr.readline()
        return str(re.findall(r"Listening on .*:(\d+);", log)[0])

    server = serve("0")
    goal = peer.ask("start", "", 10)
    node.kill()
    assert served.executive.result(goal, LONGEST).state is GoalState.CANCELED
    second = start("-m", "armtree", "ros2", "--server", served.server.url)
    port = ready(server)
    names = ("--", "--ros-args", "-r", "__ns:=/other")
    start("-m", "armtree", "ros2", "--server", f"http://127.0.0.1:{port}", *names)
    assert peer.ask("result_of", goal) == 5
    peer.ask("start", "", 10)
    assert peer.ask("result_of", goal) == 5  # so the node has read the earlier request, too
    second.send_signal(signal.SIGTERM)
    assert peer.ask("wait") == 5
    assert second.wait(LONGEST) == 128 + signal.SIGTERM

    peer.ask("start", "/other", 10)
    server.kill()
    server.wait()
    server = serve(port)
    assert peer.ask("wait") == 6
    ready(server)
    peer.ask("start", "/other", 10)
    assert peer.ask("trigger", "/other", "stop")[0]
    assert peer.ask("wait") == 5
    server.kill()
    assert peer.ask("until_unknown", "/other")
    assert peer.ask("rejected", "/other", 10)
    assert peer.ask("cancel", "/other") == [1, []]
