"""The template of docstrings is compiled once: numpydoc compiles it for each of thousands."""

from __future__ import annotations

from typing import Any, ClassVar

from jinja2 import Template
from jinja2.sandbox import SandboxedEnvironment
from numpydoc import docscrape_sphinx
from sphinx.application import Sphinx


class _Remembering(SandboxedEnvironment):
    """An environment whose templates serve all that are made after it."""

    templates: ClassVar[dict[str, Template]] = {}

    def get_template(self, name: Any, *others: Any, **more: Any) -> Template:
        if name not in self.templates:
            self.templates[name] = super().get_template(name, *others, **more)
        return self.templates[name]


def setup(_: Sphinx) -> dict[str, bool]:
    """Let numpydoc's environments remember."""
    docscrape_sphinx.SandboxedEnvironment = _Remembering
    return {"parallel_read_safe": True, "parallel_write_safe": True}
