"""Limits of the operating system are named, and checked before an arm is opened."""

import errno
import os
import resource
import threading
from pathlib import Path

import pytest

from executive.host_limits import check_host, spare_files
from hardware import HostLimit, host_limit
from hardware.files import read_file


def found(error: BaseException) -> str:
    limit = host_limit(error)
    return str(limit) if limit else ""


@pytest.mark.parametrize(
    ("error", "option"),
    [
        (OSError(errno.EMFILE, "Too many open files", "a"), "`ulimit -n`"),
        (OSError(errno.EFBIG, "File too large"), "`ulimit -f`"),
        (OSError(errno.ENOMEM, "Cannot allocate memory"), "`ulimit -v`"),
        (MemoryError(), "`ulimit -v`"),
    ],
)
def test_an_error_of_a_limit_names_it(error: BaseException, option: str) -> None:
    assert found(error).endswith(f"; raise the limit ({option}), then run again")


def test_a_thread_that_cannot_start_names_the_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_words: object) -> None:
        raise threading.ThreadError("can't start new thread")  # as the interpreter does

    monkeypatch.setattr(threading, "_start_new_thread", refuse)
    with pytest.raises(RuntimeError) as caught:
        threading.Thread(target=int).start()
    assert "`ulimit -u`" in found(caught.value)


def test_other_errors_are_no_limits(tmp_path: Path) -> None:
    assert not found(RuntimeError("no"))
    assert not found(OSError(errno.ENOENT, "No such file"))
    large = tmp_path / "large"
    large.write_bytes(bytes(11))
    with pytest.raises(OSError, match="larger than 10 bytes") as caught:
        read_file(large, 10)
    assert not found(caught.value)


def test_open_files_are_checked() -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    taken = len(os.listdir("/proc/self/fd"))
    try:
        resource.setrlimit(resource.RLIMIT_NOFILE, (taken + 24, hard))
        check_host(1)
        assert spare_files(1, most=5) == 0
        with pytest.raises(HostLimit, match=f"may open {taken + 24} .* needs {taken + 26}; .*1024"):
            spare_files(1, least=2, most=5)
        resource.setrlimit(resource.RLIMIT_NOFILE, (taken + 23, hard))
        with pytest.raises(HostLimit, match=f"needs {taken + 24};"):
            check_host(1)
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def test_a_deleted_working_folder_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    gone = tmp_path / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    with pytest.raises(FileNotFoundError) as caught:
        check_host(1)
    assert caught.value.filename is None
