"""Skills: the leaves that task files name, and the interface to write more of them.

The names are loaded at their first use: a planner process needs only `skills.motion`.
"""

import typing

from hardware.loading.lazy_exports import lazy_exports

if typing.TYPE_CHECKING:
    from .base import WorldChange as WorldChange
    from .context import (
        Context as Context,
        LeaderRead as LeaderRead,
        Planned as Planned,
        Scheduled as Scheduled,
        SkillEvent as SkillEvent,
    )
    from .errors import (
        BadBody as BadBody,
        BadQuestion as BadQuestion,
        BadTarget as BadTarget,
        ConditionFails as ConditionFails,
        FunctionFailed as FunctionFailed,
        Interrupted as Interrupted,
        NoLeader as NoLeader,
        OutOfBounds as OutOfBounds,
        SkillBroken as SkillBroken,
        SkillError as SkillError,
        StartMoved as StartMoved,
        TaskFailed as TaskFailed,
        TookTooLong as TookTooLong,
        Unanswered as Unanswered,
        combine_errors as combine_errors,
        known_errors as known_errors,
        refuse as refuse,
    )
    from .example_nodes import (
        EXAMPLE_CONDITION as EXAMPLE_CONDITION,
        NODE_FOR as NODE_FOR,
        compare_node as compare_node,
        condition_with as condition_with,
        wait_node as wait_node,
    )
    from .function import Cancel as Cancel, condition as condition, skill as skill
    from .joint_targets import (
        check_targets as check_targets,
        distance_errors as distance_errors,
        joint_errors as joint_errors,
    )
    from .leader import Blocked as Blocked, Leader as Leader, NullLeader as NullLeader

    # Not from `base`, so that the shipped skills are registered before a user defines another one.
    from .leaves import Skill as Skill
    from .ports import Port as Port, Positions as Positions
    from .question import NoOperator as NoOperator, Operator as Operator, Question as Question
    from .tool_target import (
        TOOL_PORTS as TOOL_PORTS,
        query_tool_target as query_tool_target,
        tool_target_errors as tool_target_errors,
    )
else:
    __getattr__ = lazy_exports(__name__)
