"""Example skills: two functions and a class. They simulate a light barrier and a gauge."""

from py_trees.common import Status

from skills import Cancel, Context, Port, Positions, Skill, condition, skill

# The light barrier is interrupted between these times, in every minute of the clock [s].
NEAR = (3.0, 4.5)


@condition
def nobody_near(context: Context) -> bool:
    """Return True if the light barrier is free."""
    begin, end = NEAR
    return (context.clock.now() - begin) % 60.0 >= end - begin


@skill
def measure(samples: int, cancel: Cancel) -> float:
    """Measure a height [m]: the mean of some samples, one every tenth of a second."""
    heights = []
    for number in range(samples):
        if cancel.wait(0.1):
            break
        heights.append(0.2 + 0.01 * number)
    return sum(heights) / max(1, len(heights))


class Nod(Skill):
    """Return the target of a nod."""

    may_fail = False

    INPUT_PORTS = {"by": Port(float, unit="rad", least=0.0, most=0.5, description="how far [rad]")}
    OUTPUT_PORTS = {"target": Port(Positions, description="where to [rad]")}

    def on_start(self) -> Status:
        """Write the target."""
        self._set_output("target", Positions({"joint_3": -self.get_input("by")}))
        return Status.SUCCESS
