"""One self-contained HTML page of pictures, tables and words: no network, no script, legible in light and dark."""

from __future__ import annotations

import base64
import dataclasses
from collections.abc import Sequence
from pathlib import Path

from ..files.images import image_info
from ..files.whole import writing


@dataclasses.dataclass(frozen=True)
class Text:
    """A paragraph, or a command as it was typed (`kind="command"`)."""

    text: str
    kind: str = "text"


@dataclasses.dataclass(frozen=True)
class Picture:
    """An image file that the page carries inside, with its caption, which is also its alternative text."""

    path: Path
    caption: str

    @property
    def source(self) -> str:
        return "data:image/png;base64," + base64.b64encode(self.path.read_bytes()).decode("ascii")

    @property
    def width(self) -> int:
        return image_info(self.path).columns

    @property
    def height(self) -> int:
        return image_info(self.path).rows


@dataclasses.dataclass(frozen=True)
class Pictures:
    """Pictures side by side, each at least `least` pixels wide where the screen allows."""

    pictures: Sequence[Picture]
    least: int = 300
    kind: str = "pictures"


@dataclasses.dataclass(frozen=True)
class Table:
    """A table: its head, and rows of cells already worded."""

    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    kind: str = "table"


@dataclasses.dataclass(frozen=True)
class Section:
    """A titled part of the page."""

    title: str
    parts: Sequence[Text | Pictures | Table]


@dataclasses.dataclass(frozen=True)
class Page:
    """The page: title, a lead of a sentence or two, sections, a line at the foot."""

    title: str
    lead: str
    sections: Sequence[Section]
    foot: str = ""

    def write(self, path: str | Path) -> Path:
        """Write the page to `path`, whole or not at all."""
        from jinja2 import Environment, PackageLoader, StrictUndefined

        loader = PackageLoader("gonio.viewer")
        template = Environment(loader=loader, autoescape=True, undefined=StrictUndefined).get_template("page.html")
        with writing(Path(path)) as temporary:
            temporary.write_text(template.render(page=self), encoding="utf-8")
        return Path(path)
