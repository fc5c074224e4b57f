"""What clients of a server do with recordings."""

import tempfile
from pathlib import Path
from typing import Any
from urllib.parse import quote
from urllib.request import urlopen

import pytest
from mcap.writer import IndexType, Writer

from executive.server.playback import recording_list as folder_of_recordings
from executive.server.playback.recording_list import RecordingFilter, RecordingFolder
from hardware import RealClock, SimulatedClock
from logs.reading.file_state import locked
from logs.writing.compaction import Copy
from logs.writing.recovery import recover
from tests.support.recordings.alterations import records_of
from tests.support.recordings.finished import at_rest, rest
from tests.support.servers.serving import Serve, Served

pytest_plugins = ["tests.support.servers.server_fixtures"]


def ran(served: Served, *tasks: int) -> list[str]:
    """Run tasks; return the names of their recordings."""
    for task in tasks:
        served.executive.result(served.executive.send(task).identity)
    at_rest(served.folder / "recordings")
    return [row["name"] for row in rows(served)]


def rows(served: Served, query: str = "") -> list[dict[str, Any]]:
    status, answer = served.ask("GET", f"/api/recordings{query}", token=False)
    assert status == 200
    found: list[dict[str, Any]] = answer["recordings"]
    return found


def ends(window: dict[str, Any]) -> list[dict[str, Any]]:
    return [each for each in window["events"] if each["event"] == "status"]


def test_rows_of_deleted_and_changed_files_are_not_kept(tmp_path: Path) -> None:
    """A server runs for weeks, and its page lists the recording that is being written."""
    folder, kept = RecordingFolder(tmp_path, RealClock()), tmp_path / "kept.mcap"
    (tmp_path / "deleted.mcap").touch()
    for text in ("1", "22", "333"):
        kept.write_text(text)
        folder.rows(RecordingFilter())
    (tmp_path / "deleted.mcap").unlink()
    listed = folder.rows(RecordingFilter())
    assert [row["bytes"] for row in listed] == [3]
    assert folder._rows.values() == listed


def test_recordings_are_listed_and_found(serve: Serve) -> None:
    served = serve()
    newest, *others = ran(served, 11, 13, 12)
    (say, fail, nothing) = rows(served)
    assert (say["name"], say["title"], say["state"]) == (newest, "task 12 say", "SUCCEEDED")
    assert (fail["state"], fail["message"], fail["code"]) == (
        "ABORTED",
        "The task failed: so",
        "task.failed",
    )
    assert nothing["bytes"] > 1000
    assert nothing["stamp_ns"] < fail["stamp_ns"]
    assert rows(served, "?search=TASK+13") == [fail] == rows(served, "?state=ABORTED")
    assert rows(served, "?task=11") == [nothing]
    assert rows(served, f"?since={fail['stamp_ns']}&limit=1") == [say]
    assert rows(served, f"?until={fail['stamp_ns']}") == [fail, nothing]
    assert rows(served, f"?before={newest}") == [fail, nothing]
    assert [row["name"] for row in rows(served, f"?before={others[0]}")] == [others[1]]


def test_a_folder_is_made_only_for_a_copy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    recordings = RecordingFolder(tmp_path / "recordings", SimulatedClock())
    assert recordings.rows(RecordingFilter()) == []
    assert not list(tmp_path.iterdir())  # a killed server could not remove it


def test_a_recording_is_pinned_deleted_and_restored(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    served = serve()
    (name,) = ran(served, 11)
    path = f"/api/recordings/{name}"
    file = served.folder / "recordings" / name
    content = file.read_bytes()
    assert served.ask("GET", f"{path}/file", token=False) == (200, content)
    for act in ("pin", "delete", "restore", "verify"):
        assert served.ask("POST", f"{path}/{act}", token=False)[0] == 401
    status, row = served.ask("POST", f"{path}/pin")
    assert (status, row["pinned"]) == (200, True)
    status, error = served.ask("POST", f"{path}/delete")
    assert (status, error["code"]) == (409, "log.unreadable")
    assert "is pinned; unpin it first" in error["message"]
    assert served.ask("POST", f"{path}/pin", {"on": False})[1]["pinned"] is False
    assert served.ask("POST", f"{path}/delete") == (200, {"name": name})
    assert rows(served) == []
    assert served.ask("GET", path)[0] == 404
    assert served.ask("POST", f"{path}/restore")[1]["name"] == name
    assert file.read_bytes() == content
    assert served.ask("POST", f"{path}/restore")[0] == 409
    served.ask("POST", f"{path}/delete")
    monkeypatch.setattr(folder_of_recordings, "UNDO", -1.0)
    assert rows(served) == []  # what can no longer be restored is deleted
    assert served.ask("POST", f"{path}/restore")[0] == 409


def test_names_never_leave_the_folder(serve: Serve) -> None:
    served = serve(active=False)
    folder = served.folder / "recordings"
    (served.folder / "secret.mcap").write_bytes(b"secret")
    (folder / "link.mcap").symlink_to(served.folder / "secret.mcap")
    names = ("../secret.mcap", "..%2fsecret.mcap", "/etc/passwd", ".mcap", "..", "link.mcap")
    for name in (*names, "a\x00.mcap", "no.mcap", "no.mcap.deleted", f"{'a' * 300}.mcap"):
        for act in ("", "/events", "/series", "/robot", "/file"):
            assert served.ask("GET", f"/api/recordings/{quote(name)}{act}")[0] in (404, 422)
        for act in ("pin", "delete", "restore", "verify"):
            assert served.ask("POST", f"/api/recordings/{quote(name)}/{act}")[0] in (404, 409, 422)
    assert (served.folder / "secret.mcap").read_bytes() == b"secret"
    (folder / "foreign.mcap").write_bytes(b"\x89MCAP0\r\nnothing")
    (folder / "20990100T000000.000Z-2.mcap").write_bytes(b"no day 0")
    assert [row["state"] for row in rows(served)] == ["UNFINISHED"] * 2
    assert served.ask("GET", "/api/recordings/foreign.mcap")[0] == 409
    assert served.ask("POST", "/api/recordings/foreign.mcap/delete")[0] == 409


def test_what_is_there_of_an_unfinished_recording_is_shown(serve: Serve) -> None:
    served = serve()
    goal = served.executive.send(10).identity  # it waits for an hour
    while served.executive.status().node != "wait":
        rest(served.clock, 0.01)
    (row,) = rows(served)
    path = f"/api/recordings/{row['name']}"
    assert (row["state"], row["code"]) == ("UNFINISHED", "log.in_use")
    assert served.ask("GET", path)[1]["ended"] is False
    window = served.ask("GET", f"{path}/events?at=1000")[1]
    nodes = {each["path"]: each for each in window["events"] if each["event"] == "node"}
    assert nodes["wait"]["status"] == "RUNNING"
    assert ends(window) == []
    assert served.ask("GET", f"{path}/nodes")[1]["nodes"][0]["file"].endswith("10_wait.yaml")
    assert served.ask("GET", f"{path}/robot")[1]["name"] == "arduinobot"
    content = (served.folder / "recordings" / row["name"]).read_bytes()
    with urlopen(f"{served.server.url}{path}/file") as answer:  # without a size, which changes
        assert (answer.length, answer.read()) == (None, content)
    served.executive.cancel()
    served.executive.result(goal)
    at_rest(served.folder / "recordings")
    assert served.ask("GET", path)[1]["ended"] is True
    killed = served.folder / "recordings" / "20990101T000000.000Z-10.mcap"
    killed.write_bytes(content[:-20])  # as after kill -9
    assert served.ask("GET", f"/api/recordings/{killed.name}")[1]["ended"] is False
    assert killed.read_bytes() == content[:-20]
    (end,) = ends(served.ask("GET", f"/api/recordings/{killed.name}/events?at=1000")[1])
    assert end["result"]["code"] == "server.restarted"
    assert recover(killed)  # as the next server does
    (row,) = rows(served, "?state=UNFINISHED")
    assert (row["name"], row["title"]) == (killed.name, "task 10 wait")
    assert (row["code"], row["message"]) == ("server.restarted", end["result"]["message"])
    (again,) = ends(served.ask("GET", f"/api/recordings/{killed.name}/events?at=1000")[1])
    assert (again["state"], again["result"]["code"]) == ("ABORTED", "server.restarted")
    empty = killed.with_name("20990102T000000.000Z-10.mcap")
    for data in (b"", content[:10], content[:2000]):
        empty.write_bytes(data)
        for part in ("", "/events?at=1", "/series", "/nodes"):
            status, error = served.ask("GET", f"/api/recordings/{empty.name}{part}")
            assert (status, error["code"]) == (409, "log.unreadable")
            assert error["message"].endswith(
                "has no message yet; if a run writes it, read it again later; if not, delete it"
            )
    empty.write_bytes(b"")  # as right after its creation
    with locked(empty):
        newest = rows(served)[0]
    assert (newest["name"], newest["code"]) == (empty.name, "log.in_use")


@pytest.mark.slow
def test_a_recording_without_an_index_is_copied(
    serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    served = serve()
    (name,) = ran(served, 11)
    whole = served.folder / "recordings" / name
    foreign = whole.with_name("foreign.mcap")
    with foreign.open("wb") as stream:
        writer = Writer(stream, use_chunking=False, index_types=IndexType.NONE)
        Copy(writer).all(records_of(whole))
        writer.finish()  # type: ignore[no-untyped-call]
    content = foreign.read_bytes()
    monkeypatch.setattr(folder_of_recordings, "MAX_COPY", len(content) - 1)
    status, error = served.ask("GET", "/api/recordings/foreign.mcap")
    assert (status, error["code"]) == (409, "log.unreadable")
    assert "is large and has no index" in error["message"]
    monkeypatch.setattr(folder_of_recordings, "MAX_COPY", len(content))
    about = served.ask("GET", f"/api/recordings/{name}")[1]
    assert served.ask("GET", "/api/recordings/foreign.mcap")[1] == about | {"name": "foreign.mcap"}
    assert foreign.read_bytes() == content


@pytest.mark.slow
def test_a_recording_is_verified_and_its_robot_described(serve: Serve) -> None:
    served = serve()
    (name,) = ran(served, 2)
    folder = RecordingFolder(served.folder / "recordings", served.clock)
    answer = folder.verify(name)  # takes longer than a request of this test may
    assert (answer["holds"], answer["error"]) == (True, "")
    assert [each["question"] for each in answer["verdicts"]] == ["plan -> frames", "goal -> plan"]
    robot = served.ask("GET", f"/api/recordings/{name}/robot")[1]
    assert robot == served.ask("GET", "/api/robot")[1]
    series = served.ask("GET", f"/api/recordings/{name}/series?points=10")[1]["commanded"]
    assert len(series["times_s"]) <= 10
    window = served.ask("GET", f"/api/recordings/{name}/events?at=1.5")[1]
    assert window["from_s"] <= 1.5 <= window["to_s"]
    about = served.ask("GET", f"/api/recordings/{name}")[1]
    assert about["duration_s"] > 0
