"""Extensions of the site, which are no package that is installed."""

import importlib.util

from tests.docs.transcripts import DOCS


def extension(name):
    """Load one from its file."""
    spec = importlib.util.spec_from_file_location(name, DOCS / "extensions" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


stated = extension("stated").stated
