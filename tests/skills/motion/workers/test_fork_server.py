"""The fork server: what its workers know, and what its end costs."""

import dataclasses
import os
import signal
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from hardware import RealClock, Robot, load_robot
from skills.motion import BadWorld, Body, Box, Mesh, Plan, PlanCanceled, Pool, World
from skills.motion.planner import Planner
from skills.motion.workers import fork_server
from skills.motion.workers.fork_server import ForkServer
from skills.motion.workers.worker_process import WorkerProcess
from skills.motion.world import mesh_stamps
from tests.support.pools import (
    LONG,
    PICK,
    Answer,
    answered,
    ask,
    idle,
    pid,
    running,
    until,
    until_at_work,
    wait_for_end,
    wait_until_gone,
)


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot()


FAR = World((Body("cube", Box((0.1, 0.1, 0.1)), (2.0, 0.0, 0.1)),))


def loaded(pool: Pool, world: World) -> bool:
    """True if the fork server has loaded a world."""
    server = pool._server
    assert server
    with server._lock:
        return server._world == world and server._has_loaded()


def stamps(pool: Pool) -> object:
    """Stamps of the mesh files that the fork server has loaded."""
    assert pool._server
    return pool._server._stamps


@pytest.mark.slow
def test_a_worker_after_a_kill_knows_the_world_of_the_last_answer(robot: Robot) -> None:
    with closing(Pool(robot, 1, RealClock())) as pool:
        pool.start()
        near = dataclasses.replace(PICK, world=FAR)
        assert "world" in answered(pool, near).milliseconds
        until(lambda: loaded(pool, FAR))
        for _ in range(3):
            worker, answer = idle(pool), Answer()
            pool.submit(dataclasses.replace(LONG, world=FAR), answer).cancel()
            assert isinstance(answer.wait(), PlanCanceled)
            assert "world" not in answered(pool, near).milliseconds
            assert pid(pool) != worker
            wait_until_gone(worker)
        assert pool._server
        server = pool._server.pid
    assert not running(server)


@pytest.mark.slow
@pytest.mark.parametrize("memory_is_left", [False, True])
def test_a_world_is_loaded_during_a_long_job_if_memory_is_left(
    robot: Robot, monkeypatch: pytest.MonkeyPatch, memory_is_left: bool
) -> None:
    monkeypatch.setattr("skills.motion.workers.worker_process._SLOW", 0.01)
    monkeypatch.setattr(fork_server, "has_spare_memory", lambda: memory_is_left)
    with closing(Pool(robot, 1, RealClock())) as pool:
        pool.start()
        answered(pool, PICK)
        answer = Answer()
        job = pool.submit(dataclasses.replace(LONG, world=FAR), answer)
        if memory_is_left:
            until(lambda: loaded(pool, FAR))
        else:
            until_at_work(pid(pool))
        job.cancel()
        assert isinstance(answer.wait(), PlanCanceled)
        plan = answered(pool, dataclasses.replace(PICK, world=FAR))
        assert ("world" not in plan.milliseconds) is memory_is_left


@pytest.mark.slow
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP])
def test_a_fork_server_that_dies_or_stops_is_replaced_when_it_is_needed(
    robot: Robot, how: signal.Signals
) -> None:
    with closing(Pool(robot, 1, RealClock())) as pool:
        pool.start()
        answered(pool, PICK)
        assert pool._server
        server, worker = pool._server.pid, idle(pool)
        os.kill(server, how)
        os.waitid(os.P_PID, server, os.WEXITED | os.WSTOPPED | os.WNOWAIT)
        answered(pool, PICK)
        assert pid(pool) == worker  # it needs no server
        os.kill(worker, signal.SIGKILL)
        wait_for_end(worker)
        answered(pool, PICK)
        assert pool._server.pid != server
        assert not running(server)


@pytest.fixture(scope="module")
def large(tmp_path_factory: pytest.TempPathFactory) -> World:
    """A mesh that takes a second or more to read."""
    count = 120_000
    record = [("normal", "<3f4"), ("corners", "<9f4"), ("attributes", "<u2")]
    triangles = np.zeros(count, dtype=record)
    triangles["corners"] = np.random.default_rng(1).uniform(-0.1, 0.1, (count, 9))
    file = tmp_path_factory.mktemp("large") / "large.stl"
    file.write_bytes(bytes(80) + count.to_bytes(4, "little") + triangles.tobytes())
    return World((Body("mesh", Mesh(str(file)), (2.0, 0.0, 0.1)),))


@pytest.mark.slow
def test_the_timeout_begins_when_the_meshes_are_read(robot: Robot, large: World) -> None:
    query = dataclasses.replace(PICK, world=large, timeout=0.5)
    with closing(Pool(robot, 1, RealClock())) as pool:
        pool.start()
        assert answered(pool, query).milliseconds["world"] > 500
    assert Planner(robot).plan(query).milliseconds["world"] > 500


@pytest.mark.slow
def test_meshes_that_take_too_long_to_read_end_the_job(
    robot: Robot, large: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("skills.motion.workers.worker_process._READ", 0.05)
    with closing(Pool(robot, 1, RealClock())) as pool:
        pool.start()
        late = ask(pool, dataclasses.replace(PICK, world=large))
        assert isinstance(late, BadWorld)
        assert "meshes with fewer triangles" in str(late)
        answered(pool, PICK)


@pytest.mark.slow
def test_a_job_waits_for_a_fork_server_only_while_it_loads_the_world_of_the_job(
    robot: Robot, large: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("skills.motion.workers.worker_process._SLOW", 0.01)
    with closing(Pool(robot, 1, RealClock())) as pool:
        pool.start()
        answered(pool, PICK)
        assert pool._server
        server = pool._server.pid
        for _ in range(2):  # the second one needs a new worker
            job = pool.submit(dataclasses.replace(PICK, world=large), lambda _: None)
            until(pool._server.is_loading)
            job.cancel()
        assert pool._server.is_loading()
        assert pool._server.pid == server
        answered(pool, PICK)
        assert pool._server.pid != server


@pytest.mark.slow
def test_a_worker_that_was_canceled_before_its_fork_is_not_forked(robot: Robot) -> None:
    with closing(ForkServer(robot)) as server:
        os.kill(server.pid, signal.SIGSTOP)
        for _ in range(20):
            WorkerProcess(server, robot).close()
        os.kill(server.pid, signal.SIGCONT)
        with closing(WorkerProcess(server, robot)) as worker:
            assert isinstance(worker.call(PICK), Plan)
            stat = Path(f"/proc/{server.pid}/stat").read_text().rpartition(")")[2].split()
            assert stat[8] == "0"  # page faults of its ended children: there are none


@pytest.mark.slow
def test_a_fork_server_that_does_not_read_a_world_is_killed(robot: Robot) -> None:
    box = Box((0.01, 0.01, 0.01))
    large = World(tuple(Body(f"{i:0>300}", box, (2.0, 0.0, 0.1)) for i in range(1000)))
    with closing(ForkServer(robot)) as server:
        with closing(WorkerProcess(server, robot)) as worker:
            assert isinstance(worker.call(PICK), Plan)  # the server has loaded the robot
        os.kill(server.pid, signal.SIGSTOP)
        server.load(large)
        assert not server.alive


@pytest.mark.slow
def test_jobs_succeed_if_their_fork_server_dies_before_it_forks_their_workers(
    robot: Robot,
) -> None:
    with closing(Pool(robot, 2, RealClock())) as pool:
        pool.start()
        until(lambda: pool._server)
        assert pool._server
        server = pool._server
        until(lambda: all(slot.process for slot in pool._slots))
        answers = [Answer(), Answer()]
        for answer in answers:
            pool.submit(PICK, answer)
        os.kill(server.pid, signal.SIGKILL)
        for answer in answers:
            assert isinstance(answer.wait(), Plan)
        assert pool._server is not server


@pytest.mark.slow
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP])
def test_a_worker_that_has_answered_nothing_yet_and_dies_affects_no_job(
    robot: Robot, how: signal.Signals
) -> None:
    with closing(Pool(robot, 1, RealClock())) as pool:
        pool.start()
        until(lambda: pool._slots[0].idle)
        until(lambda: pool._slots[0].process and pool._slots[0].process.forked)
        worker = pid(pool)
        os.kill(worker, how)
        if how is signal.SIGKILL:
            wait_for_end(worker)
        else:
            until(lambda: fork_server.is_stopped(worker))
        answered(pool, PICK)
        assert pid(pool) != worker


@pytest.mark.slow
def test_a_mesh_whose_file_has_changed_is_loaded_again(robot: Robot, tmp_path: Path) -> None:
    file = tmp_path / "triangle.stl"
    facet = "facet normal 0 0 1\nouter loop\n{}endloop\nendfacet\n"
    corners = "".join(f"vertex {x} {y} {z}\n" for x, y, z in np.eye(3).tolist())
    file.write_text(f"solid a\n{facet.format(corners)}endsolid a\n")
    world = World((Body("mesh", Mesh(str(file)), (2.0, 0.0, 0.1)),))
    with closing(Pool(robot, 1, RealClock())) as pool:
        pool.start()
        answered(pool, dataclasses.replace(PICK, world=world))
        until(lambda: loaded(pool, world))
        os.utime(file, (1.0, 1.0))
        answered(pool, dataclasses.replace(PICK, world=world))
        until(lambda: loaded(pool, world) and stamps(pool) == mesh_stamps(world))


@pytest.mark.slow
def test_no_process_outlives_the_pool(robot: Robot) -> None:
    for _ in range(5):
        with closing(Pool(robot, 2, RealClock())) as pool:
            pool.start()
            answered(pool, PICK)
            until_forked(pool)
            assert pool._server
            workers = [slot.process.pid for slot in pool._slots if slot.process]
            processes = [pool._server.pid, *workers]
        assert not any(running(process) for process in processes if process)


def until_forked(pool: Pool) -> None:
    until(lambda: all(slot.process and slot.process.forked for slot in pool._slots))
