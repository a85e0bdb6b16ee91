"""Facts about pages and plots: they carry all they show, and show words as words."""

import re
from html.parser import HTMLParser

import numpy as np
import pytest

import gonio as gn
from gonio.viewer.page import Page, Picture, Pictures, Section, Table, Text
from gonio.viewer.plots import lobes


@pytest.fixture
def page(tmp_path):
    """The text of a page with every kind of part, and words that would be markup if they were let."""
    gn.write_image(tmp_path / "dot.png", np.full((3, 5, 3), 0.5))
    parts = (
        Text("a < b & <script>alert(1)</script>"),
        Text("gonio render -o x.exr", "command"),
        Pictures((Picture(tmp_path / "dot.png", 'a "dot" <b>'),), 100),
        Table(("name", "value"), [("<i>", "1")]),
    )
    path = Page("T & <u>", "lead", [Section("S", parts)], "foot").write(tmp_path / "index.html")
    return path.read_text(encoding="utf-8")


class Elements(HTMLParser):
    """The elements of a page with their attributes, and its words."""

    def __init__(self, text):
        super().__init__()
        self.found, self.words = [], ""
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))

    def handle_data(self, data):
        self.words += data


def test_a_page_asks_nothing_of_the_network(page):
    assert not re.search(r"https?:|//[a-z]|url\(|@import", page)
    found = Elements(page).found
    assert not {"script", "link", "iframe"} & {tag for tag, _ in found}
    assert all(attributes["src"].startswith("data:image/png;base64,") for tag, attributes in found if tag == "img")


def test_words_are_shown_as_they_are(page):
    seen = Elements(page)
    assert "a < b & <script>alert(1)</script>" in seen.words
    assert not {"b", "i", "u"} & {tag for tag, _ in seen.found}
    (picture,) = (attributes for tag, attributes in seen.found if tag == "img")
    assert (picture["alt"], picture["width"], picture["height"]) == ('a "dot" <b>', "5", "3")


def test_a_page_that_fails_leaves_nothing_behind(tmp_path):
    missing = Picture(tmp_path / "no.png", "none")
    with pytest.raises((OSError, gn.GonioError)):
        Page("T", "lead", [Section("S", (Pictures((missing,)),))]).write(tmp_path / "index.html")
    assert not list(tmp_path.iterdir())


def test_lobes_are_drawn_on_any_paper(tmp_path):
    png = pytest.importorskip("cv2")
    path = lobes(tmp_path / "lobes.png", {"matte": gn.Lambert(0.5), "black": gn.Lambert(0.0)})
    alpha = png.imread(str(path), png.IMREAD_UNCHANGED)[..., 3]
    assert alpha.min() == 0
    assert alpha.max() == 255
