"""One place for "did you mean"."""

from hardware.suggestions import choices, closest, corrections, suggestion


def test_the_most_similar_name_is_suggested() -> None:
    assert suggestion("griper", ["arm", "gripper"]) == "; did you mean gripper?"
    assert suggestion("xyz", ["arm", "gripper"]) == ""
    assert suggestion("joint_7", ["joint_1", "joint_2"], ["joint_2"]) == "; did you mean joint_1?"


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


def test_of_many_names_the_five_nearest_are_shown() -> None:
    names = ["Ask", "Attach", "Detach", "Fail", "Say", "Set", "SetStart", "Wait"]
    assert choices("Wiat", names) == "Wait, Attach, Ask, Say, Set and 3 more; did you mean Wait?"
    assert choices("x", names[:6]) == "Ask, Attach, Detach, Fail, Say, Set"


def test_case_and_signs_between_words_do_not_count() -> None:
    assert closest("MoveJoints", ["move_tool", "move_joints"]) == "move_joints"


def test_equally_similar_names_are_not_suggested_unless_one_begins_so() -> None:
    assert suggestion("joint_7", ["joint_1", "joint_2", "joint_3"]) == ""
    assert suggestion("=", ["!=", "<=", "==", ">="]) == "; did you mean ==?"
