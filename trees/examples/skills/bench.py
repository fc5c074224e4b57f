"""Skills of one's own: two functions and a class. They stand in for a light barrier and a gauge."""

from py_trees.common import Status

from skills import Cancel, Context, Port, Positions, Skill, condition, skill

# Somebody is near between these times after the program began, in every minute [s].
NEAR = (3.0, 4.5)


@condition
def nobody_near(context: Context) -> bool:
    """Whether the light barrier is free."""
    come, gone = NEAR
    return (context.clock.now() - come) % 60.0 >= gone - come


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
    """Say where to nod to."""

    may_fail = False

    INPUT_PORTS = {"by": Port(float, unit="rad", least=0.0, most=0.5, description="how far [rad]")}
    OUTPUT_PORTS = {"target": Port(Positions, description="where to [rad]")}

    def on_start(self) -> Status:
        """Tell."""
        self._set_output("target", Positions({"joint_3": -self.get_input("by")}))
        return Status.SUCCESS
