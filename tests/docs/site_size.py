"""How much a built site has to read: the words of its pages, and those in sentences.

Counted is what stands in the main part of a page, navigation and equations' sources left out.
Words in sentences are those outside tables, code and its output.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path

UNREAD = {"script", "style", "nav", "annotation", "svg", "iframe"}
NO_SENTENCES = {"table", "pre", "math"}


@dataclass
class _Text(HTMLParser):
    """The text of a page's main part, and that of its sentences."""

    open: list[str] = field(default_factory=list)
    every: list[str] = field(default_factory=list)
    sentences: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__init__()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag == "article" or (self.open and tag in UNREAD | NO_SENTENCES):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if self.open and self.open[-1] == tag:
            self.open.pop()

    def handle_data(self, data: str) -> None:
        if self.open and not UNREAD & {*self.open}:
            self.every.append(data)
            if not NO_SENTENCES & {*self.open}:
                self.sentences.append(data)


def words(page: str) -> tuple[int, int]:
    """Return how many words a page has, and how many of them in sentences."""
    text = _Text()
    text.feed(page)
    return len("".join(text.every).split()), len("".join(text.sentences).split())


def sizes(root: Path) -> dict[str, tuple[int, int]]:
    """Return the words of every page of a site."""
    pages = sorted(root.rglob("*.html"))
    return {str(p.relative_to(root)): words(p.read_text(encoding="utf-8")) for p in pages}


def megabytes(root: Path) -> float:
    """Return what a site weighs, without what Sphinx keeps for its next build."""
    kept = root / ".doctrees"
    files = [p for p in root.rglob("*") if p.is_file() and kept not in p.parents]
    return sum(path.stat().st_size for path in files) / 1e6
