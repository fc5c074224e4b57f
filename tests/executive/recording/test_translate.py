"""The record of a plan holds everything to plan it again."""

from pathlib import Path

import logs
from executive.replay.verification import verify
from tests.conftest import RigMaker
from tests.support.recordings.alterations import altered, replace

CLOSE = """
task: 7
name: close
description: Round a box so closely that the frames of the first way touch it.
tree:
  sequence:
    - AddBox: {body: box, size: [0.0715, 0.077, 0.0376], position: [-0.1128, 0.0795, 0.1911]}
    - subtree: reach
      with: {arm: {joint_1: -0.04, joint_2: 1.09, joint_3: 1.54}, gripper: {joint_4: 0}}
    - subtree: reach
      with: {arm: {joint_1: 0.91, joint_2: -0.54, joint_3: -0.35}, gripper: {joint_4: 0}}
"""


def test_a_path_that_keeps_more_distance_holds(rig: RigMaker, tmp_path: Path) -> None:
    (tmp_path / "7_close.yaml").write_text(CLOSE)
    (outcome,) = rig(tasks=tmp_path).run(7)
    assert outcome.success, outcome.message
    path = Path(outcome.recording)
    records = logs.Recording(path).records(logs.Plan)
    spares = [record.spare for record in records if isinstance(record, logs.Plan)]
    assert sorted(spares) == [0.0, 0.0, 0.0, 0.002]
    assert verify(path).holds
    verification = verify(altered(path, replace("Message", b'"spare":0.002', b'"spare":0.000')))
    assert [check.holds for check in verification.checks] == [True, False]
