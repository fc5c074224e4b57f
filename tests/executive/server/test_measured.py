"""What a server shows of an arm that measures."""

import json
import re
from pathlib import Path

import pytest
from websockets.sync.client import connect

from hardware import BoardLink, RealClock, load_robot
from hardware.drivers.feetech.virtual.bus import Bus, Fault
from skills.motion import Pool
from tests.support.servers.serving import Served

pytestmark = pytest.mark.slow

pytest_plugins = ["tests.support.servers.server_fixtures"]


def test_measured_is_beside_commanded_and_rosbridge_says_which_one_it_has(
    real_pool: Pool, real_clock: RealClock, tmp_path: Path
) -> None:
    robot = load_robot(Path("so101"))
    model = robot.model()
    assert model
    link = BoardLink(model, real_clock)
    served = Served(robot, real_pool, tmp_path, real_clock, link)
    assert isinstance(model, Bus)
    served.start(active=True, rosbridge=True)
    try:
        model.fail(real_clock.now(), Fault("lose", 6, 0.0, 2))
        while served.ask("GET", "/api/where")[1]["lost"]["gripper"] < 2:
            assert served.ask("GET", "/api/status")[1]["arm"] == "active"
        metrics = served.ask("GET", "/metrics")[1].decode()
        lost = dict(re.findall(r'armtree_lost_answers\{joint="(\w+)"\} ([\d.]+)', metrics))
        assert float(lost["gripper"]) >= 2  # a busy machine may lose more
        status = served.ask("GET", "/api/status")[1]
        assert lost.keys() == status["commanded"].keys()
        assert status["measured"].keys() == status["commanded"].keys()
        where = served.ask("GET", "/api/where")[1]
        assert where["temperature"]["gripper"] == 25.0
        assert where["voltage"].keys() == where["measured_effort"].keys() == where["units"].keys()
        with connect(f"ws://127.0.0.1:{served.server.port}/", compression=None) as rosbridge:
            rosbridge.send(json.dumps({"op": "subscribe", "topic": "/joint_states"}))
            joints = json.loads(rosbridge.recv(10))["msg"]
        assert joints["header"]["frame_id"] == "measured"
        assert joints["position"] == list(status["measured"].values())
        assert len(joints["velocity"]) == len(joints["effort"]) == len(joints["name"])
        assert joints["effort"] == pytest.approx([*where["measured_effort"].values()], abs=0.1)
    finally:
        served.stop()
