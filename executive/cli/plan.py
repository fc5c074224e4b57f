"""`armtree plan`."""

import json
from pathlib import Path

import click

from .settings import option
from .support.command_group import command
from .support.names import complete_goal, load_library
from .support.options import (
    drawing_option,
    robot_option,
    skills_option,
    target_argument,
    trees_option,
)
from .terminal.streams import echo


@command(context_settings={"ignore_unknown_options": True})  # -0.1 is a number, not an option
@target_argument("goal", complete_goal)
@robot_option
@trees_option
@skills_option
@click.option(
    "--start",
    multiple=True,
    metavar="GOAL",
    help="Start of the motion, in quotes: joints, poses or a point, written like GOAL. Default: "
    "the start pose of the robot file.",
)
@click.option(
    "--via",
    multiple=True,
    metavar="GOAL",
    help="A point to pass without a stop, written like --start. May be repeated.",
)
@click.option("--relative", is_flag=True, help="Count x y z from the tool's position at the start.")
@click.option("--direction", nargs=3, metavar="X Y Z", help="Direction of the tool's axis.")
@click.option("--tool", metavar="LINK", help="Link with the tool. Default: the robot file's tool.")
@click.option("--offset", nargs=3, metavar="X Y Z", help="Position of the tool on its link [m].")
@click.option("--axis", nargs=3, metavar="X Y Z", help="Axis of the tool on its link.")
@option("world")
@click.option(
    "--group",
    metavar="GROUP",
    help="Group of joints that moves. Default: the group of the named joints, else the arm.",
)
@option("seed")
@option("planning_timeout")
@drawing_option(default=Path("plan.png"), show_default=True)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object, in rad, m and s.")
def plan(
    goal: tuple[str, ...],
    robot: Path | None,
    trees: Path | None,
    start: tuple[str, ...],
    via: tuple[str, ...],
    relative: bool,
    direction: tuple[str, str, str] | None,
    tool: str | None,
    offset: tuple[str, str, str] | None,
    axis: tuple[str, str, str] | None,
    world: Path | None,
    group: str | None,
    seed: int,
    planning_timeout: float,
    output: Path,
    as_json: bool,
) -> None:
    """Plan a motion without an arm; explain it and draw it.

    The explanation names the limits that set the duration. GOAL is one of:

    \b
      JOINT=VALUE     a joint; the others do not move
      JOINT+=CHANGE   a joint, counted from the start
      POSE            a pose of poses.yaml
      X Y Z           a point for the tool
      TASK            a task: motions known before a run

    Numbers without a unit are in rad and m. Joints and poses can be combined. If a pose and a task
    have the same name, the word means the pose.

    \b
    Examples:
      armtree plan joint_1=70deg joint_2+=0.1
      armtree plan right --start folded --via upright
      armtree plan 0.1 0.05 8cm --world bodies.json
      armtree plan 1

    \b
    A file for --world; the page *Plan and explain* has more:
      [{"name": "post", "box": {"size": [0.03, 0.03, 0.2]},
        "position": [0.115, 0.115, 0.1]}]
    """  # noqa: D301
    from skills.motion.workers.memory import check_memory

    check_memory()  # before the import of NumPy, which also needs memory
    from executive.preview.explanation import Explanation
    from executive.preview.plan_request import PlanRequest

    vectors = {"direction": direction, "offset": offset, "axis": axis}
    tool_inputs = {port: f"[{', '.join(words)}]" for port, words in vectors.items() if words}
    tool_inputs |= ({"relative": "true"} if relative else {}) | ({"tool": tool} if tool else {})
    words = " ".join(start).split()
    loaded, library = load_library(trees, robot)
    request = PlanRequest(loaded, library, goal, group, seed, words, via, tool_inputs)
    explanation = Explanation(request, world, planning_timeout, output)
    if as_json:
        echo(json.dumps(explanation.to_json()))
    else:
        for line in explanation.lines():
            echo(line)
