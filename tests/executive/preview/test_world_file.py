"""World files: the example of the documentation, and the errors of invalid ones."""

import json
import re
from dataclasses import fields
from pathlib import Path
from typing import Any, get_args

import pytest
from click.testing import CliRunner, Result

from executive.cli.main import cli
from executive.code_table import look_up
from executive.errors import BadWorldFile
from executive.preview.world_file import read_world
from skills.motion import Body, Box, Shape, Sphere
from tests.support.paths import ROOT

PAGE = ROOT / "docs/pages/how_to/plan.md"
POST = '{"name": "post", "box": {"size": [0.03, 0.03, 0.2]}}'


def plan(*arguments: str) -> Result:
    return CliRunner().invoke(cli, ["plan", *arguments])


@pytest.mark.usefixtures("undrawn")
def test_the_example_of_the_page(tmp_path: Path) -> None:
    (example,) = re.findall(r"```json\n(\[.*?)```", PAGE.read_text(), re.DOTALL)
    file = tmp_path / "world.json"
    file.write_text(example)
    post, ball = read_world(file).bodies
    assert (post.shape, ball.shape) == (Box((0.03, 0.03, 0.2)), Sphere(0.01))
    assert (post.link, ball.link) == ("", "claw_support")
    result = plan("right", "--world", str(file), "-o", str(tmp_path / "plan.png"))
    assert result.exit_code == 0, result.exception
    assert "Path      around an obstacle" in result.output
    assert "Bodies    post, ball on claw_support" in result.output


def test_the_keys_of_the_page() -> None:
    """The page lists every key of a body and its shape, and no other."""
    (table,) = re.findall(
        r"\| key \| holds \| default \|\n[|-]+\n(.*?)\n\n", PAGE.read_text(), re.DOTALL
    )
    keys = {part.name for part in fields(Body)} - {"shape"}
    kinds = {str(kind.__name__).lower(): kind for kind in get_args(Shape)}
    parts = {part.name for kind in kinds.values() for part in fields(kind)}
    assert set(re.findall(r"`(\w+)`", table)) == keys | kinds.keys() | parts | {"floor"}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (f'[{POST}, {{"name": "b", "spere": 1}}]', 'Body 2: "spere" is not a key of b; .* sphere?'),
        ('{"a": 1}', '{"a": 1} is not a list of bodies'),
        (
            '[{"name": "b", "link": "x", "link": "y"}]',
            ":1:29: the key link is given twice, first in line 1",
        ),
        (
            '[{"name": "b", "box": {"size": 1, "size": 2}}]',
            "1:35: the key size is given twice",
        ),
        ('[{"link": "x", "link": "y", "name": 7}]', ":1:16: the key link is given twice"),
        (f"[{POST},\n", ":2:1: is not JSON: Expecting value"),
        ("[" * 100_000, "nested too deep"),
        (" " * (2**20 + 1), "cannot be read: it is larger than 1048576 bytes"),
        (f"[{', '.join([POST] * 1001)}]", "There are 1001 bodies"),
        ("[\xff]".encode("latin-1").decode("utf-8", "surrogateescape"), "is not JSON"),
        (f"[{POST}, {POST}]", "Two bodies have the name post"),
    ],
)
def test_a_wrong_file_is_named_with_what_is_wrong(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "world.json"
    file.write_text(text, encoding="utf-8", errors="surrogateescape")
    with pytest.raises(BadWorldFile, match=f"{re.escape(str(file))}.*{message}"):
        read_world(file)


def test_all_mistakes_are_reported_with_their_lines(tmp_path: Path) -> None:
    file = tmp_path / "world.json"
    file.write_text(
        '[\n{"name": "a", "box": {"size": 0.03},\n "pose": [1, 0, 0], "rotation": [0, 0, 1.57]},\n'
        '{"name": "b", "sphere": {"radus": 1}}]'
    )
    with pytest.raises(BadWorldFile) as caught:
        read_world(file)
    found = [(m.place.line, m.place.location, m.message) for m in caught.value.mistakes]
    assert [each[:2] for each in found] == [
        (2, "[0].box.size"),
        (3, "[0].pose"),
        (3, "[0].rotation"),
        (4, "[1].sphere.radus"),
    ]
    assert found[1][2].endswith(
        '"pose" is not a key of a; the keys are name, position, rotation, '
        "link, touches, box, sphere, cylinder, mesh; did you mean position?"
    )
    assert str(caught.value).endswith('  write:\n    {"name": "b", "sphere": {"radius": 1}}]')


def test_too_many_bodies_have_no_line(tmp_path: Path) -> None:
    """To find a line in so large a file takes seconds."""
    file = tmp_path / "world.json"
    file.write_text(f"[{', '.join(POST.replace('post', f'post{i}') for i in range(1001))}]")
    with pytest.raises(BadWorldFile) as caught:
        read_world(file)
    assert str(caught.value).endswith(
        "world.json: There are 1001 bodies; the limit is 1000. Give fewer, larger ones, or one mesh"
    )


@pytest.mark.parametrize(
    ("wrong", "right"),
    [
        ('"box": {"size": 0.03}', '"box": {"size": [0.03, 0.03, 0.03]}'),
        ('"box": [0.1, 0.1, 0.2]', '"box": {"size": [0.1, 0.1, 0.2]}'),
        ('"sphere": {"radius": "2 cm"}', '"sphere": {"radius": 0.02}'),
        (
            '"sphere": {"radius": 1}, "position": {"x": 0.2, "y": 0, "z": 0.1}',
            '"sphere": {"radius": 1}, "position": [0.2, 0, 0.1]',
        ),
        (
            '"sphere": {"radius": 1}, "rotation": [0, 0, 3.14159]',
            '"sphere": {"radius": 1}, "rotation": [0.0, 0.0, 1.0, 1.327e-06]',
        ),
    ],
)
def test_a_value_in_another_form_is_corrected(tmp_path: Path, wrong: str, right: str) -> None:
    file = tmp_path / "world.json"
    file.write_text(f'[{{"name": "a", {wrong}}}]')
    with pytest.raises(BadWorldFile) as caught:
        read_world(file)
    (mistake,) = caught.value.mistakes
    assert mistake.instead
    assert mistake.instead.text == f'[{{"name": "a", {right}}}]'
    file.write_text(mistake.instead.text)
    assert len(read_world(file).bodies) == 1


def test_a_file_may_be_yaml(tmp_path: Path) -> None:
    file = tmp_path / "world.yaml"
    file.write_text("# around the arm\n- name: post\n  box: {size: [0.03, 0.03, 0.2]}\n")
    assert read_world(file).bodies == (Body("post", Box((0.03, 0.03, 0.2))),)
    file.write_text("- name: post\n  bocks: 7\n")
    with pytest.raises(BadWorldFile, match=r":2:3: Body 1: \"bocks\" is not a key of post"):
        read_world(file)


def test_a_file_that_is_not_there_is_one_that_is_wrong(tmp_path: Path) -> None:
    result = plan("right", "--world", str(tmp_path / "nowhere.json"))
    assert isinstance(result.exception, BadWorldFile)
    assert "nowhere.json: cannot be read: No such file" in str(result.exception)
    assert look_up(result.exception.code).exit_status == 3


@pytest.mark.parametrize(
    ("more", "why"),
    [
        (
            {"link": "claw"},
            "post is attached to claw: There is no link claw; the links are world, ",
        ),
        ({"touches": ["flor"]}, "post may touch flor, but there is no such link or body"),
        ({"name": "base_link"}, "The robot already has a base_link"),
        ({"name": "ball"}, "Two bodies have the name ball; rename one"),
        ({"mesh": {"path": "none.stl"}}, "The mesh FOLDER/none.stl cannot be read: there is no /"),
        ({"mesh": {"path": "."}}, "The mesh FOLDER cannot be read: it is not an ordinary file"),
        ({"mesh": {"path": __file__}}, f"The mesh {__file__} cannot be read: "),
    ],
)
def test_bodies_that_do_not_fit_the_robot(tmp_path: Path, more: dict[str, Any], why: str) -> None:
    file = tmp_path / "world.json"
    ball = {"name": "ball", "sphere": {"radius": 0.01}, "position": [1, 0, 0]}
    post = json.loads(POST) | more
    if "mesh" in more:
        del post["box"]
    lines = (f'"{key}": {json.dumps(value)}' for key, value in post.items())
    file.write_text(f"[{json.dumps(ball)}, {{\n" + ",\n".join(lines) + "\n}]")
    line = 2 + list(post).index(next(iter(more)))
    for goal in ("right", "1"):
        result = plan(goal, "--world", str(file))
        assert isinstance(result.exception, BadWorldFile)
        why = why.replace("FOLDER", str(tmp_path))
        assert str(result.exception).startswith(f"{file}:{line}:1: {why}")
