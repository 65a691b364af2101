"""What a built site refers to, and what of it is missing."""

from __future__ import annotations

from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

FILES = (".png", ".svg")  # ends of what is a name of a file and says nothing
LOADS = {"script": "src", "img": "src", "link": "href", "source": "src", "iframe": "src"}


@dataclass
class Page(HTMLParser):
    """Names, links and images of one page, and what a browser loads to show it."""

    names: set[str] = field(default_factory=set)
    links: list[str] = field(default_factory=list)
    loads: list[str] = field(default_factory=list)
    images: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__init__()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        self.names |= {given[name] for name in ("id", "name") if name in given}
        if tag == "a" and given.get("href"):
            self.links.append(given["href"])
        loaded = given.get(LOADS.get(tag, ""))
        if loaded and given.get("rel") not in ("next", "prev", "index", "search"):
            self.loads.append(loaded)
        if tag == "img":
            self.images.append(given.get("alt", ""))


def read(path: Path) -> Page:
    """Return what a page refers to."""
    page = Page()
    page.feed(path.read_text(encoding="utf-8"))
    return page


def broken(root: Path) -> list[str]:
    """Return links that lead nowhere, what is loaded from elsewhere, and images without words."""
    pages = {path.resolve(): read(path) for path in sorted(root.rglob("*.html"))}
    found = []
    for path, page in pages.items():
        outside = [address for address in page.loads if urlsplit(address).netloc]
        lost = [link for link in page.links if not _leads(path, link, pages)]
        mute = [f"image {words!r}" for words in page.images if not words or words[-4:] in FILES]
        faults = (*outside, *lost, *mute)
        found += [f"{path.relative_to(root.resolve())}: {what}" for what in faults]
    return found


def _leads(path: Path, link: str, pages: dict[Path, Page]) -> bool:
    parts = urlsplit(link)
    if parts.scheme or parts.netloc:
        return True
    target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
    if not target.exists():
        return False
    name = unquote(parts.fragment)
    return not name or target not in pages or name in pages[target].names
