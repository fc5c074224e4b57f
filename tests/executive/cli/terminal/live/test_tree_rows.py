"""The tree of a run, folded to the rows of a terminal."""

from collections.abc import Mapping

import pytest

import logs
from executive.cli.terminal.live.tree_rows import Row, tree_rows


def nodes(statuses: Mapping[str, str]) -> dict[str, logs.NodeStatus]:
    return {
        path: logs.NodeStatus(0.0, path, path.rpartition("/")[2], status, "")
        for path, status in statuses.items()
    }


def flat(before: int, status: str, after: int) -> dict[str, logs.NodeStatus]:
    children = ["SUCCESS"] * before + [status] + ["INVALID"] * after
    return nodes({"root": "RUNNING"} | {f"root/n{k}": s for k, s in enumerate(children)})


def words(rows: list[Row]) -> list[str]:
    return [f"{row.guide}{row.name}" for row in rows]


def test_a_tree_that_fits_is_whole() -> None:
    rows = tree_rows(nodes({"a": "RUNNING", "a/b": "SUCCESS", "a/b/c": "SUCCESS", "a/d": ""}), 4)
    assert words(rows) == ["a", "├── b", "│   └── c", "└── d"]


def test_what_is_done_is_folded_first() -> None:
    tree = {"a": "RUNNING", "a/b": "SUCCESS", "a/b/c": "SUCCESS", "a/b/d": "SUCCESS"}
    rows = tree_rows(nodes(tree | {"a/e": "RUNNING", "a/e/f": "RUNNING"}), 4)
    assert words(rows) == ["a", "├── b", "└── e", "    └── f"]
    assert rows[1].message == "2 nodes"


@pytest.mark.parametrize("status", ["RUNNING", logs.HALTED])
@pytest.mark.parametrize("most", [2, 3, 5, 8, 20])
def test_the_node_at_work_is_shown_with_its_neighbours(most: int, status: str) -> None:
    rows = tree_rows(flat(200, status, 300), most)
    assert len(rows) <= most
    assert "n200" in {row.name for row in rows}
    if most >= 5:
        assert words(rows)[1].startswith("├── … ")
        assert words(rows)[-1].startswith("└── … ")
    if most >= 8:
        assert {"n199", "n200", "n201"} <= {row.name for row in rows}


def test_hidden_nodes_are_counted_by_what_became_of_them() -> None:
    rows = tree_rows(flat(200, "RUNNING", 300), 4)
    assert [row.name for row in rows] == ["root", "… 200 done", "n200", "… 300 to come"]


def test_without_room_for_siblings_their_number_is_beside_the_name() -> None:
    rows = tree_rows(flat(200, "RUNNING", 300), 2)
    assert (rows[1].name, rows[1].message) == ("n200", "201 of 501")


def test_of_a_failed_tree_the_node_that_failed_it_is_shown() -> None:
    tree = {"a": "FAILURE"} | {f"a/n{k}": "SUCCESS" for k in range(40)}
    tree |= {"a/s": "FAILURE"} | {f"a/s/n{k}": "SUCCESS" for k in range(40)}
    rows = tree_rows(nodes(tree | {"a/s/last": "FAILURE"}), 8)
    assert [row.name for row in rows if row.at_work] == ["a", "s", "last"]


def test_a_failure_that_a_fallback_handled_is_not_one_of_the_task() -> None:
    rows = tree_rows(nodes({"a": "SUCCESS", "a/b": "FAILURE", "a/c": "SUCCESS"}), 3)
    assert [row.at_work for row in rows] == [True, False, False]


def test_a_deep_tree_shows_the_rows_around_the_deepest_node() -> None:
    paths = ["/".join(f"n{k}" for k in range(depth)) for depth in range(1, 40)]
    rows = tree_rows(nodes(dict.fromkeys(paths, "RUNNING")), 6)
    assert len(rows) <= 6
    assert rows[0].name == "… 34 more above"
    assert rows[-1].name == "n38"
    assert [row.name for row in tree_rows(nodes(dict.fromkeys(paths, "RUNNING")), 1)] == ["n38"]


def test_many_nodes_at_work() -> None:
    tree = {"a": "RUNNING"} | {f"a/n{k}": "RUNNING" for k in range(50)}
    rows = tree_rows(nodes(tree), 6)
    assert len(rows) <= 6
    assert rows[-1].name == "n49"
