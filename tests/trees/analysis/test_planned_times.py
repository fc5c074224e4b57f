"""A timeout that ends before its motions: an error if it always does, a note if as planned."""

from pathlib import Path

import pytest

from hardware import Robot
from skills.motion import Pool, Query
from trees.check import Findings, check

pytestmark = pytest.mark.slow

RIGHT, UPRIGHT = "{arm: right, gripper: closed}", "{arm: upright, gripper: open}"
BOTH = f"{{sequence: [{{subtree: reach, with: {RIGHT}}}, {{subtree: reach, with: {UPRIGHT}}}]}}"
SLOWLY = "{subtree: move_joints, with: {joints: right, speed: 0.5}}"
TOOL = "{subtree: move_tool, with: {point: [0.1, 0.1, 0.15]}}"
WAITING = f"{{sequence: [{{Wait: {{duration: 4 s}}}}, {{subtree: reach, with: {RIGHT}}}]}}"
# Around the post; a straight line would take 3.4 s.
AROUND = (
    "{sequence: [{AddBox: {body: tall, size: [3 cm, 3 cm, 20 cm], "
    "position: [0.115, 0.115, 0.1]}}, {subtree: reach, with: " + RIGHT + "}]}"
)
UNKNOWN = "{selector: [{subtree: move_joints, with: {joints: right}}, Succeed]}"

ROWS = {
    (BOTH, "7.8 s"): "fails after 7.8 s; as planned from the boot pose, its child takes 9.2 s",
    (BOTH, "10 s"): "",
    (SLOWLY, "4 s"): "fails after 4 s; as planned from the boot pose, its child takes 6.7 s",
    (TOOL, "0.9 s"): "fails after 0.9 s; as planned from the boot pose, its child takes 2.7 s",
    (WAITING, "7 s"): "fails after 7 s; as planned from the boot pose, its child takes 7.4 s",
    (AROUND, "3.5 s"): "fails after 3.5 s; as planned from the boot pose, its child takes ",
    (UNKNOWN, "0.1 s"): "",
    (BOTH, "1 s"): "fails after 1 s; as planned from the boot pose, its child takes 9.2 s",
}


@pytest.fixture(scope="module")
def findings(robot: Robot, tmp_path_factory: pytest.TempPathFactory) -> Findings:
    folder = tmp_path_factory.mktemp("t")
    for number, (child, after) in enumerate(ROWS, 20):
        text = f"task: {number}\nname: x\ndescription: y\ntree:\n  timeout: {child}\n"
        (folder / f"{number}_x.yaml").write_text(f"{text}  after: {after}\n")
    return check(robot, folder)


@pytest.mark.parametrize("row", ROWS)
def test_a_timeout_is_compared_with_its_motions(findings: Findings, row: tuple[str, str]) -> None:
    name, words = f"{20 + [*ROWS].index(row)}_x.yaml", ROWS[row]
    is_error = row == (BOTH, "1 s")  # from any start
    is_note = not is_error and bool(words)
    for found, expected in ((findings.mistakes, is_error), (findings.notes, is_note)):
        said = [each for each in found if each.place.path.name == name]
        assert len(said) == expected
        for each in said:
            assert words in each.message
            assert (each.place.line, each.place.location) == (6, "tree.after")
            assert each.instead


def test_nothing_is_planned_without_a_timeout(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    planned: list[Query] = []
    submit = Pool.submit

    def counted(pool: Pool, request: object, *rest: object) -> object:
        planned.extend([request] if isinstance(request, Query) else [])
        return submit(pool, request, *rest)  # type: ignore[arg-type]

    monkeypatch.setattr(Pool, "submit", counted)
    for limit, count in (("", 0), ("timeout: ", 4)):
        text = f"task: 20\nname: x\ndescription: y\ntree: {{{limit or 'force_success: '}{BOTH}"
        (tmp_path / "20_x.yaml").write_text(text + (", after: 30 s}\n" if limit else "}\n"))
        assert not check(robot, tmp_path).mistakes
        assert len(planned) == count
