"""FollowLeader is paused in any state of the arm."""

from hardware.errors import PortLost
from skills.leaves.follow_leader import FollowLeader
from tests.conftest import Bench


def test_a_pause_after_a_fault_is_no_mistake_of_the_skill(bench: Bench) -> None:
    skill: FollowLeader = bench.skill(FollowLeader)
    bench.arm.fault(PortLost("/dev/ttyACM0", "unplugged"))
    skill.on_pause()
    assert not skill.busy
