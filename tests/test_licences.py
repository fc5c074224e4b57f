"""What others may do with armtree, and with everything that it needs."""

import tomllib

import pytest

from tests.support.generated.licences import ROS2, RUNS, licence, pins, table
from tests.support.paths import ROOT

# A school or a firm may use, change and pass on armtree under Apache-2.0 with these. MPL-2.0 covers
# only the files that it came with, and they are not changed.
ACCEPTED = {
    "0BSD", "Apache-2.0", "BSD-2-Clause", "BSD-3-Clause", "BSL-1.0", "CC0-1.0",
    "Matplotlib", "MIT", "MIT-0", "MIT-CMU", "MPL-2.0", "PSF-2.0", "Qhull", "Zlib",
}  # fmt: skip


pytestmark = pytest.mark.skipif(not ROS2.is_dir(), reason="ROS 2 has no wheels here")


def test_the_licences_of_what_armtree_uses_agree_with_its_own() -> None:
    found = {name: licence(name) for lock in RUNS for name in pins(lock)}
    parts = {name: of.replace(" OR ", " AND ").split(" AND ") for name, of in found.items() if of}
    missing = {name for name, of in found.items() if not of}
    assert missing == {"httpx2-jsfetch", "pywin32"}  # on other systems only
    assert {name: of for name, of in parts.items() if not set(of) <= ACCEPTED} == {}


def test_the_list_of_licences_is_complete() -> None:
    """`python -m tests.support.generated.licences` prints it."""
    page = (ROOT / "docs" / "dependencies.md").read_text()
    assert "\n".join(table()) in page


def test_the_metadata_names_the_licence_files() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert project["license"] == "Apache-2.0"
    assert all((ROOT / name).is_file() for name in project["license-files"])
