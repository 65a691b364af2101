"""Equations as MathML, written when the site is built.

Browsers draw MathML themselves, so that equations need no network and no script, can be searched
and copied, and are read aloud by screen readers.
"""

from __future__ import annotations

from docutils import nodes
from math_core import LatexError, LatexToMathML
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.writers.html5 import HTML5Translator

_CONVERTER = LatexToMathML(annotation=True)


def mathml(latex: str, *, block: bool) -> str:
    """Return LaTeX as MathML; several lines of a displayed equation are aligned at their ``&``."""
    several = block and r"\\" in latex and r"\begin" not in latex
    text = rf"\begin{{aligned}}{latex}\end{{aligned}}" if several else latex
    try:
        return _CONVERTER.convert_with_local_state(text, displaystyle=block)
    except LatexError as error:
        message = f"the equation {latex!r} cannot become MathML: {error}"
        raise ExtensionError(message) from error


def _inline(translator: HTML5Translator, node: nodes.math) -> None:
    translator.body.append(f'<span class="math">{mathml(node.astext(), block=False)}</span>')
    raise nodes.SkipNode


def _block(translator: HTML5Translator, node: nodes.math_block) -> None:
    equation = mathml(node.astext(), block=True)
    translator.body.append(f'<div class="math" tabindex="0">{equation}</div>')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the renderer that ``html_math_renderer`` names."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
