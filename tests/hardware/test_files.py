"""Files of users: ordinary ones up to a size are read, all others are refused at once."""

import os
from pathlib import Path

import pytest

from hardware.files import read_file


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
    with pytest.raises(OSError, match="no ordinary file"):
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
