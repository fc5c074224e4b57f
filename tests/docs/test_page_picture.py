"""The moving picture of the page shows the words that the page shows today."""

import pytest
from PIL import Image

from tests.support.generated.page_pictures import DESCRIPTION, SCREEN, run_pick, show_moment, words
from tests.support.generated.tour_cast import ASSETS
from tests.support.servers.browsing import Open, shows
from tests.support.servers.serving import Served

pytest_plugins = ["tests.support.servers.browser_fixtures", "tests.support.servers.server_fixtures"]


@pytest.mark.slow
def test_it_has_the_words_of_todays_page(open_page: Open, page_server: Served) -> None:
    run_pick(page_server)
    tab = open_page(viewport=SCREEN)
    shows(tab, "#shown", "recorded")
    show_moment(tab, 1.0)
    with Image.open(ASSETS / "page.webp") as picture:
        kept = picture.getexif().get(DESCRIPTION, "")
    for _ in range(200):  # a busy machine loads and draws that moment late
        if words(tab) == kept:
            return
        tab.wait_for_timeout(100)
    assert words(tab) == kept, (
        "python -m tests.support.generated.page_pictures docs/pages/assets page"
    )
