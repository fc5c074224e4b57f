"""The checker for all planners reads every kind of joint."""

import numpy as np

from tests.bench.planners.reference.padded import Description
from tests.bench.planners.reference.reference_checker import ReferenceChecker

_LINK = '<link name="{}"><collision><origin xyz="{} 0 0"/><geometry><box size="0.1 0.1 0.1"/>'
_LINKS = ("base", -1.0), ("first", 0.0), ("second", 1.0)
_JOINT = '<joint name="{0}_joint" type="{1}"><parent link="{2}"/><child link="{0}"/>'
_LIMIT = '<axis xyz="0 0 1"/><limit lower="-4" upper="4" velocity="1" effort="1"/></joint>'


def test_a_continuous_joint_beside_a_revolute_one() -> None:
    links = "".join(_LINK.format(*link) + "</geometry></collision></link>" for link in _LINKS)
    joints = ("first", "continuous", "base"), ("second", "revolute", "first")
    arm = "".join(_JOINT.format(*joint) + _LIMIT for joint in joints)
    checked = frozenset((frozenset(("base", "second")),))
    names = ("second_joint", "first_joint")
    described = Description(f'<robot name="arm">{links}{arm}</robot>', "", names, checked)
    checker = ReferenceChecker(described)
    half = 0.5 * np.pi
    for hit, row in ((False, (0.0, 0.0)), (True, (0.0, 2 * half)), (True, (half, half))):
        assert checker.collides(np.array([row])) == hit
    assert not checker.collides(np.array([(half, -half), (0.0, 4 * half), (0.5 * half, half)]))
