"""ruckig: timing alone, of a straight move, with hardly a limit on jerk; it knows no collision."""

from common import TICK, serve
from ruckig import InputParameter, Result, Ruckig, Synchronization, Trajectory


def make(problem):
    size = len(problem["joints"])
    otg, given = Ruckig(size), InputParameter(size)
    given.max_velocity, given.max_acceleration = problem["velocity"], problem["acceleration"]
    given.max_jerk, given.synchronization = [1e6] * size, Synchronization.Phase

    def solve(start, goal, seed):
        given.current_position, given.target_position = start, goal
        trajectory = Trajectory(size)
        if otg.calculate(given, trajectory) not in (Result.Working, Result.Finished):
            return None
        return trajectory

    def sample(trajectory):
        ticks = range(int(trajectory.duration / TICK) + 1)
        ends = [trajectory.at_time(trajectory.duration)[0]]
        return [trajectory.at_time(tick * TICK)[0] for tick in ticks] + ends

    return solve, sample


serve("ruckig", make)
