"""The numbers of lifecycle states and transitions in ROS 2's lifecycle_msgs."""

STATE_NUMBERS = {
    "unconfigured": 1,
    "inactive": 2,
    "active": 3,
    "finalized": 4,
    "configuring": 10,
    "cleaningup": 11,
    "shuttingdown": 12,
    "activating": 13,
    "deactivating": 14,
    "errorprocessing": 15,
}
# Numbers of requested transitions, by start state and label.
REQUEST_NUMBERS = {
    ("unconfigured", "configure"): 1,
    ("inactive", "cleanup"): 2,
    ("inactive", "activate"): 3,
    ("active", "deactivate"): 4,
    ("unconfigured", "shutdown"): 5,
    ("inactive", "shutdown"): 6,
    ("active", "shutdown"): 7,
}
_OUTCOMES = {"transition_success": 0, "transition_failure": 1, "transition_error": 2}
_OUTCOME_BASES = {
    "configuring": 10,
    "cleaningup": 20,
    "activating": 30,
    "deactivating": 40,
    "shuttingdown": 50,
    "errorprocessing": 60,
}
_CALLBACK_ERROR = 99


def transition_number(start: str, label: str) -> int:
    """Return the number of a transition.

    Args:
        start: State before the transition.
        label: Label of the transition; empty if the state did not change. The number is then 0.
    """
    if not label:
        return 0
    if (start, label) in REQUEST_NUMBERS:
        return REQUEST_NUMBERS[start, label]
    if label in _OUTCOMES and start in _OUTCOME_BASES:
        return _OUTCOME_BASES[start] + _OUTCOMES[label]
    return _CALLBACK_ERROR  # raise_error, our own transition, has no number in ROS 2
