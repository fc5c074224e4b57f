"""The moves that ship as subtrees, run as a task of one's own would."""

from pathlib import Path

from executive.testing import SimulatedArm

TASK = """
task: 9
name: moves
description: Bring the tool to a point and down a bit, then go home by way of two places.
tree:
  sequence:
    - subtree: move_tool
      with: {point: [16 cm, 4 cm, 0.2]}
    - subtree: move_tool
      with: {point: [0, 0, -2 cm], relative: true}
    - subtree: follow
      with:
        via:
          - {joint_1: 30 deg, joint_2: 0.1, joint_3: 0}
          - {joint_1: 0.8, joint_2: 0.3, joint_3: 0.1}
        arm: upright
"""


def test_the_tool_goes_to_its_target_and_the_arm_along_its_path(tmp_path: Path) -> None:
    (tmp_path / "9_moves.yaml").write_text(TASK)
    with SimulatedArm(trees=tmp_path) as rehearsal:
        outcome = rehearsal.run(9)
        bases = [int(frame[1:4]) for frame in rehearsal.frames]
        reached = rehearsal.said("ReachPoint")
    assert outcome.success, outcome.message
    assert len(set(reached)) == 2
    assert min(bases) == 8  # the tool is beside the base, which turns it there,
    assert 130 < max(bases) <= 136  # and on the way home it passes near the second place
    assert rehearsal.frames[-1] == "b090,s090,e090,g000,"
