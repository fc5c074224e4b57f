"""Files of users: ordinary ones up to a size are read, all others are refused at once."""

import errno
import os
from pathlib import Path

import pytest

from hardware.files import read_file, write_file


def test_an_ordinary_file_up_to_the_size_is_read(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_bytes(b"x" * 10)
    assert read_file(file, 10) == b"x" * 10
    with pytest.raises(OSError, match="larger than 9 bytes"):
        read_file(file, 9)


def test_a_link_to_a_file_is_the_file(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"x")
    (tmp_path / "link").symlink_to("file")
    assert read_file(tmp_path / "link", 1) == b"x"


@pytest.mark.parametrize("path", ["/dev/zero", "/dev/tty", "pipe", "link", "socket"])
def test_what_may_never_end_is_not_opened(path: str, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    os.mknod(tmp_path / "socket", 0o140600)
    (tmp_path / "link").symlink_to("pipe")
    with pytest.raises(OSError, match="not an ordinary file"):
        read_file(tmp_path / path, 10)


def test_a_file_of_any_size_is_refused_unread(tmp_path: Path) -> None:
    file = tmp_path / "file"
    with file.open("wb") as stream:
        stream.truncate(2**40)
    with pytest.raises(OSError, match="larger than 10 bytes"):
        read_file(file, 10)


@pytest.mark.parametrize(
    ("path", "words"), [("none", "No such file"), (".", "Is a directory"), ("file/x", "Not a dir")]
)
def test_the_operating_systems_words_are_kept(path: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(OSError, match=words):
        read_file(tmp_path / path, 10)


def test_a_file_is_replaced_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (file := tmp_path / "file").write_bytes(b"old")
    file.chmod(0o640)
    (link := tmp_path / "link").symlink_to(file)
    write_file(link, b"new")
    assert (link.is_symlink(), file.read_bytes()) == (True, b"new")
    assert file.stat().st_mode & 0o777 == 0o640

    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left") as refused:
        write_file(file, b"newer")
    assert refused.value.filename == str(file)
    assert file.read_bytes() == b"new"
    assert sorted(os.listdir(tmp_path)) == ["file", "link"]
