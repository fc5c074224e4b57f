"""The folder of recordings."""

import shutil
from collections import namedtuple
from pathlib import Path

import pytest

from logs import NoSpace, check_space

Usage = namedtuple("Usage", "total used free")


def test_free_space_is_known_for_a_folder_that_does_not_exist(tmp_path: Path) -> None:
    assert check_space(tmp_path / "a" / "b") > 0


def test_a_full_disk_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "disk_usage", lambda path: Usage(10, 9, 1_000_000))
    with pytest.raises(NoSpace, match="only 1 MB are free and a run may need 100 MB"):
        check_space(tmp_path)
