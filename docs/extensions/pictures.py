"""Pictures that code draws have an alternative text, as pictures of pages have."""

from __future__ import annotations

from docutils import nodes
from sphinx.application import Sphinx

WORDS = "What the code above draws"


def _describe(_app: Sphinx, doctree: nodes.document, _docname: str) -> None:
    for picture in doctree.findall(nodes.image):
        if not picture.get("alt"):
            picture["alt"] = f"{WORDS}, under the heading: {_heading(picture)}"


def _heading(node: nodes.Node) -> str:
    """Return the title of the section that a node is in."""
    while node.parent is not None and not isinstance(node, nodes.section):
        node = node.parent
    title = node.next_node(nodes.title)
    return title.astext() if title is not None else ""


def setup(app: Sphinx) -> dict[str, bool]:
    """Describe pictures before pages are written."""
    app.connect("doctree-resolved", _describe)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
