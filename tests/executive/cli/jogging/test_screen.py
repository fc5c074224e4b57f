"""Words of a jog about failures."""

from executive.api.outcome import cause_of
from executive.cli.jogging.screen import cause_words
from skills.motion.errors import Unreachable


def test_a_step_beyond_the_reach_names_the_way_out_and_no_planner() -> None:
    error = Unreachable((0.0, 0.0, 0.622), (0.0, 0.0, 0.62), 0.002, 0.0)
    cause = cause_of(error, "move/ReachPoint", f"ReachPoint: {error}")
    assert cause_words(cause) == (
        "plan.unreachable: The tool cannot reach (0.0, 0.0, 622.0) mm. The nearest point is "
        "(0.0, 0.0, 620.0) mm, 2.0 mm away; the arm is stretched out or at a limit: move a joint "
        "first"
    )
