"""The API reference: `{public} brdf` documents every public name of the modules in gonio.brdf, and none is forgotten.

The public names stand in `gonio/__init__.pyi`. Docstrings are Markdown, as everything else here; autodoc takes them
for reStructuredText, so each is handed to the Markdown parser by the directive `markdown`.
"""

import ast
from pathlib import Path

from docutils import nodes
from docutils.utils import new_document
from myst_parser.parsers.sphinx_ import MystParser
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.util.docutils import SphinxDirective

import gonio

STUB = ast.parse(Path(gonio.__file__).with_name("__init__.pyi").read_text(encoding="utf-8"))
PUBLIC = {
    alias.name: statement.module
    for statement in STUB.body
    if isinstance(statement, ast.ImportFrom) and statement.module
    for alias in statement.names
}


class Markdown(SphinxDirective):
    has_content = True

    def run(self) -> list[nodes.Node]:
        document = new_document(self.env.docname, self.state.document.settings)
        MystParser().parse("\n".join(self.content), document)
        return document.children


class Public(SphinxDirective):
    required_arguments = 1
    final_argument_whitespace = True

    def run(self) -> list[nodes.Node]:
        sections: list[nodes.Node] = []
        for part in self.arguments[0].split():
            modules = sorted({module for module in PUBLIC.values() if f"{module}.".startswith(f"{part}.")})
            if not modules:
                raise self.error(f"gonio.{part} has no public names")
            for module in modules:
                names = sorted((name for name, m in PUBLIC.items() if m == module), key=str.lower)
                documented(self.env).update(names)
                sections.append(self.section(module, names))
        return sections

    def section(self, module: str, names: list[str]) -> nodes.section:
        """The opening of a module (its equation, and what is not there), and its public names."""
        section = nodes.section(ids=[nodes.make_id(module)], names=[module])
        section += nodes.title(text=module)
        text = f".. automodule:: gonio.{module}\n   :no-index:\n\n" + "\n".join(map(rest, names))
        section += self.parse_text_to_nodes(f"```{{eval-rst}}\n{text}```\n")
        return section


def rest(name: str) -> str:
    """autodoc's directive for a public name."""
    value = getattr(gonio, name)
    if isinstance(value, type):
        return f".. autoclass:: gonio.{name}\n   :members:\n"
    return f".. autofunction:: gonio.{name}\n" if callable(value) else f".. autodata:: gonio.{name}\n"


def documented(env) -> set[str]:
    if not hasattr(env, "documented_public_names"):
        env.documented_public_names = set()
    return env.documented_public_names


def as_markdown(app, what, name, obj, options, lines: list[str]) -> None:
    if any(lines):
        lines[:] = [".. markdown::", "", *(f"   {line}" for line in lines), ""]


def none_forgotten(app: Sphinx, env) -> None:
    for name in sorted(set(PUBLIC) - documented(env)):
        logging.getLogger(__name__).warning("gonio.%s stands in no page of docs/reference", name)


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_directive("markdown", Markdown)
    app.add_directive("public", Public)
    app.connect("autodoc-process-docstring", as_markdown)
    app.connect("env-check-consistency", none_forgotten)
    return {"parallel_read_safe": False}
