"""Makes the planner process of a command lie, die or hang.

Python runs this file at its start if its folder is in PYTHONPATH. Before each answer, the planner
reads and deletes the file that `PLANNER_FAULT` names. The file has the name of a fault.
"""

import dataclasses
import os
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

if "skills.motion.workers.worker_main" in sys.orig_argv:
    import numpy as np

    from skills.motion.planner import Planner
    from skills.motion.query import Reached
    from skills.motion.trajectory.plan import Plan

    def curve(plan: Plan, **changes: Any) -> Plan:
        return dataclasses.replace(plan, curve=dataclasses.replace(plan.curve, **changes))

    def law(plan: Plan, **changes: Any) -> Plan:
        return dataclasses.replace(plan, profile=dataclasses.replace(plan.profile, **changes))

    def end_off(plan: Plan, angle: float) -> Plan:
        """A motion of the same shape to another goal."""
        off = np.full(len(plan.goal), angle)
        step = plan.goal + off - plan.origin
        moved = curve(plan, linear=step[None, :] / plan.curve.length)
        return dataclasses.replace(moved, goal=plan.goal + off)

    def elsewhere(found: Reached) -> Reached:
        """A solution within the limits, for another point."""
        return dataclasses.replace(found, positions=tuple(q + 0.01 for q in found.positions))

    LIES: dict[str, Callable[[Any], object]] = {
        "nothing": lambda plan: None,
        "a text": lambda plan: "a plan",
        "empty": lambda plan: curve(plan, constant=np.empty((0, 3)), linear=np.empty((0, 3))),
        "shapes": lambda plan: law(plan, speeds=np.zeros(1)),
        "flat": lambda plan: law(plan, times=np.float64(1.0)),
        "unknown joints": lambda plan: dataclasses.replace(plan, joints=("a", "b", "c")),
        "other group": lambda plan: dataclasses.replace(plan, group="leg"),
        "three times the speed": lambda plan: dataclasses.replace(
            plan, profile=plan.profile.slowed(1 / 3)
        ),
        "twenty times the speed": lambda plan: dataclasses.replace(
            plan, profile=plan.profile.slowed(1 / 20)
        ),
        "a year": lambda plan: dataclasses.replace(plan, profile=plan.profile.slowed(1e7)),
        "end off": lambda plan: end_off(plan, 0.1),
        "start off": lambda plan: dataclasses.replace(plan, start=plan.start + 0.1),
        "jump": lambda plan: curve(plan, constant=plan.curve.constant + 0.1),
        "huge": lambda plan: curve(plan, linear=plan.curve.linear * 1e300),
        "elsewhere": elsewhere,
        "durations": lambda plan: dataclasses.replace(
            plan, milliseconds=cast("Any", {"time": "long"})
        ),
    }

    def misbehave(fault: str) -> None:
        if fault == "exits":
            os._exit(0)
        if fault == "raises":
            raise MemoryError
        if fault == "hangs":
            time.sleep(3600)  # noqa: TID251, it hangs
        if fault.startswith("SIG"):
            os.kill(os.getpid(), signal.Signals[fault])

    honest = Planner.answer

    def answer(self: Planner, request: Any) -> Any:
        found = honest(self, request)
        path = Path(os.environ["PLANNER_FAULT"])
        fault = path.read_text() if path.exists() else ""
        tool = fault == "elsewhere"
        lies = isinstance(found, Reached) if tool else isinstance(found, Plan) and found.duration
        if not (fault and lies):
            return found
        path.unlink()
        if fault in LIES:
            return LIES[fault](found)
        misbehave(fault)
        return found

    Planner.answer = answer  # type: ignore[method-assign]
