"""Phrases that newcomers stumbled over stay out of pages, docstrings and messages."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.builders import ROOT

INSTEAD = {  # a phrase, as a pattern, and what to say instead of it
    r"\bthe study\b": "Bruun et al., or the paper",
    r"\bbut times\b": "except times",
    r"\bnot add up\b": "is inconsistent",
    r"\bdearer\b": "costs more",
    r"\bheld against\b": "compared with",
    r"\ba way opens\b": "it becomes possible",
    r"\bthat is none\b": "that does not exist; or treated as zero",
    r"\bgo(es)? without saying\b": "always holds",
    r"\b(is|are) no (assembly|box|engine|formulation|network|problem|scene|sequence)\b": "is not a",
    r"\bhalf as (much|large|long) again\b": "1.5 times",
    r"\bthe .{3,20} in the place of the\b": "instead of",
    r"\b(brick|structure|step) goes\b": "becomes unstable; or what it does",
}
ANY = re.compile("|".join(INSTEAD), re.IGNORECASE)
CODE = re.compile(r"```.*?```|`[^`]*`", flags=re.DOTALL)


def faults(text: str) -> list[str]:
    """Return the phrases of a text that should be said otherwise, each with what to say."""
    words = " ".join(text.split())
    if not ANY.search(words):
        return []
    found = [(re.search(phrase, words, re.IGNORECASE), say) for phrase, say in INSTEAD.items()]
    return [f"{match[0]!r}: say {say!r}" for match, say in found if match]


def pages() -> Iterator[tuple[str, str]]:
    """Yield every page that people read and its text, code left out."""
    for page in [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")]:
        if "_build" not in page.parts:
            yield str(page.relative_to(ROOT)), CODE.sub("", page.read_text(encoding="utf-8"))


def strings(path: Path) -> Iterator[tuple[str, str]]:
    """Yield the docstrings and messages of a module, with their lines."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield f"{path.relative_to(ROOT)}:{node.lineno}", node.value


def modules() -> Iterator[Path]:
    """Yield the modules whose docstrings and messages people read."""
    for package in ("seqopt", "formulations"):
        yield from sorted((ROOT / package).rglob("*.py"))


def test_pages_are_in_plain_words():
    read = dict(pages())
    assert len(read) > 30
    assert {name: found for name, text in read.items() if (found := faults(text))} == {}


def test_docstrings_and_messages_are_in_plain_words():
    read = [pair for path in modules() for pair in strings(path)]
    assert len(read) > 3000
    assert {line: found for line, text in read if (found := faults(text))} == {}


@pytest.mark.parametrize(
    ("text", "seen"),
    [
        ("as the study does", 1),
        ("It says what does not\nadd up, but times are left out.", 2),
        ("The studies agree; the build goes on.", 0),
    ],
)
def test_a_phrase_is_seen_and_plain_words_are_not(text, seen):
    assert len(faults(text)) == seen


def test_phrases_in_code_are_not_prose():
    assert faults(CODE.sub("", "see `the study` and\n```text\nbut times\n```\n")) == []
