"""What recording costs, what a crash costs, how small and how quick to read recordings are.

`bare_put_*`: what a queue's put to a thread that sleeps costs in the same run, for most of what
recording costs is to wake the thread that writes.
`kill_*`: whole `armtree run` processes on a pseudo-terminal, killed at random instants of a move.
`truncation_failures`: every cut, and flipped bits, of a journal and of the finished file, read and
recovered: every piece that precedes the damage is there, nothing else is, and it is seen.
`read_*`: reading as `logs.read` gives it, against the stock reader of the same run.
"""

import json
import multiprocessing
import os
import pty
import random
import subprocess
import sys
import tempfile
import threading
import time
import tty
from collections.abc import Callable
from pathlib import Path
from queue import SimpleQueue

# This file is named like a room, and its folder comes first where it is run by itself.
sys.path = [folder for folder in sys.path if Path(folder) != Path(__file__).parent]

import zstandard
from mcap.reader import make_reader
from mcap.writer import Writer

import logs
from executive.replay.verification import verify_all
from hardware import RealClock, load_robot
from logs.writing.journal import Journal
from tests.bench.table import Row, arguments, show
from tests.support.recordings.compact import compact
from tests.support.recordings.file_damage import FOOTER_BYTES, Damage, failure, take

ARMTREE = [sys.executable, "-P", "-m", "armtree"]
JOINTS = ("joint_1", "joint_2", "joint_3", "joint_4")
EPOCH_NS = 1_795_000_000_000_000_000


def sent(number: int) -> logs.Sent:
    """A frame of a motion."""
    servos = [90 + round(60 * ((number * k) % 97) / 97) for k in (1, 2, 3, 5)]
    data = "".join(f"{letter}{q:03d}," for letter, q in zip("bseg", servos, strict=True)).encode()
    positions = tuple(0.0174 * q for q in servos)
    return logs.Sent(number / 50 + 0.0003, data, number / 50, False, JOINTS, positions)


def record_costs(frames: int) -> list[float]:
    """What a frame costs the thread that sends it, at 500 frames a second [us]."""
    with (
        tempfile.TemporaryDirectory() as folder,
        logs.Recorder(Path(folder) / "x.mcap", RealClock().epoch_ns(), lambda _: None) as recorder,
    ):
        recorder.caught_up(10.0)

        def record(frame: logs.Sent) -> None:
            recorder.caught_up(0.05)
            recorder.put(frame)

        return _costs(record, frames)


def put_costs(frames: int) -> list[float]:
    """What it costs to put a frame into the queue of a thread that does nothing with it [us]."""
    queue = SimpleQueue[logs.Sent | None]()
    thread = threading.Thread(target=lambda: [*iter(queue.get, None)])
    thread.start()
    costs = _costs(queue.put, frames)
    queue.put(None)
    thread.join()
    return costs


def _costs(record: Callable[[logs.Sent], None], frames: int) -> list[float]:
    costs, clock = [], RealClock()
    signal = clock.signal()
    for number in range(frames):
        frame = sent(number)
        begun = time.perf_counter()
        record(frame)
        costs.append(1e6 * (time.perf_counter() - begun))
        with signal:
            signal.wait(clock.now() + 0.002)
    return sorted(costs)


def kills(count: int) -> tuple[int, int]:
    """Most frames the board got that a file lacks, and how many files cannot be read."""
    lost = unreadable = 0
    for number in range(count):
        rng = random.Random(number)
        with tempfile.TemporaryDirectory() as folder:
            got = _killed_run(Path(folder), rng.uniform(0.0, 2.5))
            (path,) = Path(folder).glob("*.mcap")
            try:
                logs.recover(path)
                with path.open("rb") as stream:
                    found = make_reader(stream, validate_crcs=True).iter_messages(["/serial/tx"])
                    kept = sum(1 for _ in found)
            except Exception:
                unreadable += 1
                continue
            lost = max(lost, got - kept)
    return lost, unreadable


def _killed_run(folder: Path, after: float) -> int:
    """Runs a task, kills it so long after its first frame [s], and says how many frames came."""
    robot = folder / "quick.toml"
    shipped = Path(__file__).parents[2] / "hardware" / "robots" / "arduinobot"
    text = (shipped / "arduinobot.toml").read_text()
    robot.write_text(text.replace("boot_wait_s = 2.0", "boot_wait_s = 1.05"))
    (folder / "arduinobot.urdf").write_bytes((shipped / "arduinobot.urdf").read_bytes())
    master, slave = pty.openpty()
    tty.setraw(slave)
    command = [*ARMTREE, "run", "1", "--robot", str(robot), "--port", os.ttyname(slave)]
    with subprocess.Popen(
        [*command, "--recordings", str(folder)], stdout=subprocess.DEVNULL
    ) as process:
        heard = os.read(master, 4096)  # the first frame
        timer = threading.Timer(after, process.kill)
        timer.start()
        process.wait()
        timer.cancel()
        os.set_blocking(master, False)
        try:
            while data := os.read(master, 65536):
                heard += data
        except BlockingIOError:
            pass
    os.close(slave)
    os.close(master)
    return heard.count(b"b")


def truncations(every: int, flips: int) -> int:
    """Failures: of cuts and flipped bits of a journal and of the finished file."""
    spawn = multiprocessing.get_context("spawn")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.mcap"
        journal_of(path, 100_000)
        files = {"journal": path.read_bytes()}
        compact(path)
        files["finished"] = path.read_bytes()
    rng = random.Random(1)
    damages = []
    for name, data in files.items():
        damages += [Damage(name, cut) for cut in range(0, len(data), every)]
        bits = (rng.randrange(8 * len(data)) for _ in range(flips))
        footer = range(8 * (len(data) - FOOTER_BYTES), 8 * len(data))
        damages += [Damage(name, len(data), bit) for bit in (*bits, *footer)]
    with spawn.Pool(initializer=take, initargs=(files,)) as pool:
        failures = [text for text in pool.imap_unordered(failure, damages, 200) if text]
    for text in failures:
        sys.stdout.write(f"{text}\n")
    return len(failures)


def journal_of(path: Path, size: int) -> None:
    """A journal of about this size [bytes], as a run leaves it."""
    journal = Journal(path.open("xb"), EPOCH_NS)
    journal.write(logs.Description(0.0, load_robot().urdf.read_text()))
    number = 0
    while path.stat().st_size < size:
        journal.write(sent(number))
        if number % 5 == 0:
            journal.write(
                logs.Feedback(number / 50, "0" * 32, number % 100, "executing", "Execute")
            )
        number += 1
    journal.finish()


def size_ratio() -> float:
    """A finished file of 1 MB and more over its own journal compressed."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.mcap"
        journal_of(path, 8_000_000)
        packed = len(zstandard.compress(path.read_bytes()))
        return compact(path).bytes / packed


def verified_per_core(count: int, jobs: int) -> float:
    """Motion verified per second and core [s/s], over so many recordings of real runs."""
    with tempfile.TemporaryDirectory() as folder:
        command = [*ARMTREE, "run", "0", "1", "2", "0", "1", "--port", "virtual"]
        subprocess.run([*command, "--recordings", folder], check=True, stdout=subprocess.DEVNULL)
        runs = sorted(Path(folder).glob("*.mcap"))
        paths = [runs[number % len(runs)] for number in range(count)]
        begun = time.monotonic()
        verifications = list(verify_all(paths, jobs))
        spent = time.monotonic() - begun
    assert all(verification.holds for verification in verifications)
    return sum(verification.motion for verification in verifications) / spent / jobs


def reading(messages: int) -> tuple[float, list[float]]:
    """Memory that reading adds [MiB], and our time over the stock reader's."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.mcap"
        _long_file(path, messages)
        code = "import sys; from tests.bench.logs import read_once; read_once(*sys.argv[1:])"
        facts: dict[str, list[dict[str, float]]] = {}
        for how in ("stock", "ours", "stock", "ours"):
            command = [sys.executable, "-c", code, how, str(path)]
            done = subprocess.run(command, capture_output=True, check=True, text=True)
            facts.setdefault(how, []).append(json.loads(done.stdout))
    ratios = [
        ours["seconds"] / stock["seconds"]
        for ours, stock in zip(facts["ours"], facts["stock"], strict=True)
    ]
    return max(each["mib"] for each in facts["ours"]), ratios


def read_once(how: str, path: str) -> None:
    """Reads a file through once, in a process of its own; prints what it took."""
    read = _stock if how == "stock" else _ours
    before = _peak_kib()
    begun = time.perf_counter()
    count = read(path)
    seconds = time.perf_counter() - begun
    grown = _peak_kib() - before
    sys.stdout.write(json.dumps({"seconds": seconds, "mib": grown / 1024, "count": count}))


def _peak_kib() -> int:
    """The most memory that this process has had [KiB]."""
    status = Path("/proc/self/status").read_text()
    return int(status.partition("VmHWM:")[2].split()[0])


def _stock(path: str) -> int:
    with open(path, "rb") as stream:
        return sum(1 for _ in make_reader(stream, validate_crcs=True).iter_messages())


def _ours(path: str) -> int:
    return sum(1 for _ in logs.read(Path(path)))


def _long_file(path: Path, messages: int) -> None:
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=65536, enable_data_crcs=True)
        writer.start("ros2", "bench")
        writer.add_metadata("armtree", {"epoch_ns": "0"})
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data\n")
        channel = writer.register_channel("/tree", "cdr", schema, {})
        data = b"\x00\x01\x00\x00\x10\x00\x00\x00b090,s090,e090,\x00"
        for number in range(messages):
            writer.add_message(channel, number * 1000, data, number * 1000, number)
        writer.finish()  # type: ignore[no-untyped-call]


def main() -> None:
    """Measure and show."""
    parser = arguments(__doc__ or "")
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--every", type=int, default=1, help="cut at every so many bytes")
    parser.add_argument("--flips", type=int, default=10_000)
    parser.add_argument("--recordings", type=int, default=1000)
    parser.add_argument("--messages", type=int, default=10_000_000)
    parser.add_argument("--only", default="", help="rows whose name begins so")
    given = parser.parse_args()
    jobs = os.cpu_count() or 1
    parts: dict[str, Callable[[], list[Row]]] = {
        "record": lambda: _record_rows(given.runs),
        "kill": lambda: _kill_rows(given.kills),
        "truncation": lambda: [
            Row("truncation_failures", "1", [truncations(given.every, given.flips)])
        ],
        "size": lambda: [Row("size_ratio", "1", [size_ratio()])],
        "verify": lambda: [
            Row("verify_realtime_per_core", "s/s", [verified_per_core(given.recordings, jobs)])
        ],
        "read": lambda: _read_rows(given.messages),
    }
    rows = [row for name, part in parts.items() if name.startswith(given.only) for row in part()]
    show(rows, given.json)


def _record_rows(runs: int) -> list[Row]:
    pairs = [(record_costs(2000), put_costs(2000)) for _ in range(runs)]
    costs = [cost for cost, _ in pairs]
    medians = [(ours[1000], bare[1000]) for ours, bare in pairs]
    return [
        Row("record_p50_us", "us", [ours for ours, _ in medians]),
        Row("record_p99_us", "us", [each[len(each) * 99 // 100] for each in costs]),
        Row("bare_put_p50_us", "us", [bare for _, bare in medians]),
        Row("record_over_bare_put", "1", [ours / bare for ours, bare in medians]),
    ]


def _kill_rows(count: int) -> list[Row]:
    lost, unreadable = kills(count)
    return [Row("kill_lost_max", "1", [lost]), Row("kill_unreadable", "1", [unreadable])]


def _read_rows(messages: int) -> list[Row]:
    memory, ratios = reading(messages)
    return [Row("read_1e7_mib", "MiB", [memory]), Row("read_ratio", "1", ratios)]


if __name__ == "__main__":
    main()
