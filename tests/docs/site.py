"""What a built site refers to, what of it is missing, and how much there is to read.

Counted is what stands in the main part of a page, navigation and equations' sources left out.
Words in sentences are those outside tables, code and its output.
"""

from pathlib import Path
from urllib.parse import unquote, urlsplit

from bs4 import BeautifulSoup

FILES = (".png", ".svg")  # ends of what is a name of a file and says nothing
LOADS = ["script", "img", "link", "source", "iframe"]
NO_LOADS = (["next"], ["prev"], ["index"], ["search"])  # relations of links
UNREAD = ["script", "style", "nav", "annotation", "svg", "iframe"]
NO_SENTENCES = ["table", "pre", "math"]


def parsed(text: str) -> BeautifulSoup:
    return BeautifulSoup(text, "html.parser")


def broken(root: Path) -> list[str]:
    """Return links that lead nowhere, what is loaded from elsewhere, and images without words."""
    home, found = root.resolve(), []
    pages = {path: parsed(path.read_text("utf-8")) for path in sorted(home.rglob("*.html"))}
    names = {
        path: {tag.get(key) for tag in page(True) for key in ("id", "name")}  # noqa: FBT003
        for path, page in pages.items()
    }
    for path, page in pages.items():
        loads = [tag for tag in page(LOADS) if tag.get("rel") not in NO_LOADS]
        faults = [tag.get("src") or tag.get("href") or "" for tag in loads]
        faults = [address for address in faults if urlsplit(address).netloc]
        links = [tag["href"] for tag in page("a", href=True)]
        faults += [link for link in links if link and not _leads(path, link, names)]
        images = [image.get("alt", "") for image in page("img")]
        faults += [f"image {words!r}" for words in images if not words or words.endswith(FILES)]
        found += [f"{path.relative_to(home)}: {what}" for what in faults]
    return found


def _leads(path: Path, link: str, names: dict[Path, set[str]]) -> bool:
    parts = urlsplit(link)
    if parts.scheme or parts.netloc:
        return True
    target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
    name = unquote(parts.fragment)
    return target.exists() and (not name or target not in names or name in names[target])


def words(page: str) -> tuple[int, int]:
    """Return how many words a page has, and how many of them in sentences."""
    counts, soup = [], parsed(page)
    for left_out in (UNREAD, NO_SENTENCES):
        for tag in soup(left_out):
            tag.extract()
        counts.append(sum(len(part.get_text().split()) for part in soup("article")))
    return counts[0], counts[1]


def sizes(root: Path) -> dict[str, tuple[int, int]]:
    """Return the words of every page of a site."""
    pages = sorted(root.rglob("*.html"))
    return {str(p.relative_to(root)): words(p.read_text(encoding="utf-8")) for p in pages}


def megabytes(root: Path) -> float:
    """Return what a site weighs, without what Sphinx keeps for its next build."""
    kept = root / ".doctrees"
    files = [p for p in root.rglob("*") if p.is_file() and kept not in p.parents]
    return sum(path.stat().st_size for path in files) / 1e6
