"""One place for "did you mean"."""

from hardware.spelling import choices, closest, corrections, suggestion, there_are


def test_the_most_similar_name_is_suggested() -> None:
    assert suggestion("griper", ["arm", "gripper"]) == "; did you mean gripper?"
    assert suggestion("xyz", ["arm", "gripper"]) == ""
    assert suggestion("joint_7", ["joint_1", "joint_2"], ["joint_2"]) == "; did you mean joint_1?"


def test_a_name_with_another_beginning_is_suggested_only_if_it_is_very_similar() -> None:
    poses = ["closed", "folded", "home", "open", "right", "upright"]
    assert suggestion("nope", poses) == ""
    assert suggestion("oepn", poses) == "; did you mean open?"
    assert suggestion("ome", poses) == "; did you mean home?"
    assert suggestion("tree", ["subtree"]) == "; did you mean subtree?"


def test_a_cutoff_of_0_accepts_any_name() -> None:
    assert closest("/zzz", {"/tf"}) == ""
    assert closest("/zzz", {"/tf"}, cutoff=0.0) == "/tf"


def test_choices_prefer_a_name_that_is_not_given_yet() -> None:
    assert choices("amr", ["gripper", "arm"]) == "arm, gripper; did you mean arm?"
    assert choices("arn", ["arm", "ark"], ["arm"]) == "ark, arm; did you mean ark?"
    assert choices("arn", ["arm"], ["arm"]) == "arm; did you mean arm?"
    assert choices("arn", []) == "none"


def test_two_unknown_names_are_not_corrected_to_the_same_one() -> None:
    known = ["joint_1", "joint_2"]
    assert corrections(["joint1", "jiont_1"], known) == {"joint1": "joint_1", "jiont_1": "joint_2"}
    assert corrections(["joint_1", "joint1"], known) == {"joint1": "joint_2"}
    assert corrections(["xyz"], known) == {}


def test_of_many_names_the_similar_ones_are_shown() -> None:
    names = ["Ask", "Attach", "Detach", "Fail", "Say", "Set", "SetStart", "Succeed", "Wait"]
    assert choices("x", names[:8]) == ", ".join(names[:8])
    assert choices("Wiat", names) == "Wait and 8 more; did you mean Wait?"
    assert there_are("Wiat", names) == "did you mean Wait?"
    assert there_are("Attch", names) == "did you mean Attach?"
    assert there_are("x", names) == f"there are {', '.join(names[:5])} and {len(names) - 5} more"


def test_case_and_signs_between_words_do_not_count() -> None:
    assert closest("MoveJoints", ["move_tool", "move_joints"]) == "move_joints"


def test_equally_similar_names_are_not_suggested_unless_one_begins_so() -> None:
    assert suggestion("joint_7", ["joint_1", "joint_2", "joint_3"]) == ""
    assert suggestion("=", ["!=", "<=", "==", ">="]) == "; did you mean ==?"
