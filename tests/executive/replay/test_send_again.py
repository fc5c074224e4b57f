"""The frames of a recording are sent again at their times, or not at all."""

import json
import shutil
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from executive.replay.send_again import _parts
from hardware import load_robot
from skills.errors import NotReplayable
from tests.conftest import RigMaker
from tests.end_to_end.test_command_line import events, robot as quick, sent_frames, start
from tests.support.command_line.typed import typed
from tests.support.paths import EXAMPLES
from tests.support.recordings.alterations import Change, altered, retold

pytestmark = pytest.mark.slow

__all__ = ["quick"]

ROBOT = load_robot().path
WAVE = EXAMPLES / "recordings" / "3_wave.mcap"


def test_the_same_frames_are_sent_again_as_a_run_of_its_own(
    tmp_path: Path, rig: RigMaker, quick: Path
) -> None:
    (first,) = rig().run(0)  # a short one
    recording, again = Path(first.recording), tmp_path / "again"
    where = ["--on", "virtual", "--robot", str(quick), "--recordings", str(again), "--json"]
    status, out, err = typed(tmp_path, "replay", str(recording), *where)
    assert (status, err) == (0, "")
    made = Path(events(out)[-1]["recording"])
    assert made.parent == again
    assert len(sent_frames(made)) > 3
    assert sent_frames(made) == sent_frames(recording)
    assert typed(tmp_path, "replay", str(made), "--verify")[0] == 0
    assert typed(tmp_path, "log", "diff", str(recording), str(made))[0] == 0


def test_a_replay_is_stopped_as_any_run(tmp_path: Path, picked: Path, quick: Path) -> None:
    arguments = ["replay", str(picked), "--on", "virtual", "--robot", str(quick)]
    arguments += ["--recordings", str(tmp_path), "--json"]
    with start(tmp_path, *arguments) as process:
        assert process.stdout
        reported = []
        for line in process.stdout:
            reported.append(json.loads(line))
            moved = sum(event["event"] == "sent" for event in reported)
            if moved == 5 and reported[-1]["event"] == "sent":
                process.send_signal(signal.SIGINT)
    assert process.returncode == 7
    assert [event["hold"] for event in reported if event["event"] == "sent"].count(True) == 1
    assert typed(tmp_path, "replay", reported[-1]["recording"], "--verify")[0] == 0


def test_frames_that_mean_something_else_on_this_arm_are_refused(
    tmp_path: Path, picked: Path, quick: Path
) -> None:
    quick.write_text(quick.read_text().replace("span_deg = 180", "span_deg = 200", 1))
    arguments = ["replay", str(picked), "--on", "virtual", "--robot", str(quick), "--json"]
    status, out, _ = typed(tmp_path, *arguments)
    assert status == 4
    assert "does not fit this arm" in events(out)[-1]["message"]
    assert not [event for event in events(out) if event["event"] == "sent"]


def shortened(reported: dict[str, Any]) -> None:
    """A schedule with fewer frames."""
    reported.update({name: reported[name][:9] for name in ("times", "frames", "delays_s")})


def change(name: str, make: Callable[[Any], Any], number: int = 1) -> Change:
    """Change the value of a field of a schedule."""
    return retold(
        "/schedule", lambda reported: reported.update({name: make(reported[name])}), number
    )


def test_a_replay_goes_by_the_times_of_the_schedule(picked: Path) -> None:
    times = [setpoint.time for setpoint in _parts(picked, ROBOT)[0].setpoints]
    assert len(times) == 31
    hasty = altered(picked, retold("/serial/timing", lambda reported: reported.update(time=0.0), 9))
    assert [setpoint.time for setpoint in _parts(hasty, ROBOT)[0].setpoints] == times


@pytest.mark.parametrize(
    ("schedule", "words"),
    [
        (change("times", lambda t: [x / 20 for x in t]), r"turns joint_4 by .* joint is 1 rad/s"),
        (change("times", lambda t: [*t[:9], t[8], *t[10:]]), "is due at or before the time of"),
        (retold("/schedule", shortened), "more frames were recorded than were scheduled"),
        (
            change("start", lambda q: q | {"joint_1": 0.5}, 2),
            "does not begin at the end of the previous one",
        ),
    ],
)
def test_frames_beyond_the_limits_are_not_sent(
    tmp_path: Path, schedule: Change, words: str
) -> None:
    path = Path(shutil.copy(WAVE, tmp_path))
    _parts(path, ROBOT)
    with pytest.raises(NotReplayable, match=words):
        _parts(altered(path, schedule), ROBOT)
