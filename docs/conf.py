"""Sphinx settings of the manual: no network, no warnings."""

from __future__ import annotations

import pkgutil
from importlib import import_module

from docutils import nodes
from docutils.statemachine import StringList
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from sphinx.writers.html5 import HTML5Translator

import arm3dof

project = "arm3dof"
author = "The arm3dof developers"
copyright = author
release = version = arm3dof.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
]
exclude_patterns = ["_build", "measured"]
html_theme = "furo"
html_title = f"arm3dof {version}"
html_static_path: list[str] = []
html_math_renderer = "mathml"

myst_enable_extensions = ["dollarmath", "deflist", "colon_fence"]
myst_heading_anchors = 3
# every function and class that a page names exists; names of other libraries are not looked up
nitpicky = True
nitpick_ignore_regex = [
    ("py:.*", r"(?!arm3dof\.).*"),
    # type variables
    ("py:.*", r"arm3dof\.runtime\.parallel\.(Task|Result)"),
    ("py:.*", r"arm3dof\.vision\.latest\.Item"),
    ("py:.*", r"arm3dof\.sim\.plant\.Inner"),
]

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_type_aliases = {"ArrayLike": "ArrayLike", "Array": "Array"}
autodoc_default_options = {"members": True, "show-inheritance": True}
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = False
napoleon_attr_annotations = False


class Modules(SphinxDirective):
    """Document every module in a package, but for what the page has documented already."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Return what ``automodule`` makes of each module in turn."""
        package = import_module(self.arguments[0])
        lines = []
        for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            if found.ispkg or found.name.rpartition(".")[2].startswith("_"):
                continue
            module = import_module(found.name)
            public = [name for name in arm3dof.__all__ if hasattr(module, name)]
            lines += [f".. rubric:: {found.name}", "", f".. automodule:: {found.name}"]
            lines += [f"   :exclude-members: {', '.join(public)}", ""] if public else [""]
        node = nodes.section()
        self.state.nested_parse(StringList(lines, self.arguments[0]), 0, node)
        return node.children


def _inline(translator: HTML5Translator, node: nodes.math) -> None:
    translator.body.append(tex2mathml(node.astext()))
    raise nodes.SkipNode


def _block(translator: HTML5Translator, node: nodes.math_block) -> None:
    translator.body.append(f"<div class='math'>{tex2mathml(node.astext(), as_block=True)}</div>")
    raise nodes.SkipNode


def _keep_bars(app: Sphinx, what: str, name: str, thing: object, options: object, lines: list[str]):
    """Take |x| in a docstring for a magnitude, not for a substitution."""
    for number, line in enumerate(lines):
        parts = line.split("``")  # every second part is a literal
        parts[::2] = [part.replace("|", r"\|") for part in parts[::2]]
        lines[number] = "``".join(parts)


def _skip_tuple_fields(
    app: Sphinx, what: str, name: str, thing: object, skip: bool, options: object
) -> bool | None:
    """Leave a named tuple's fields to its docstring."""
    return True if type(thing).__name__ == "_tuplegetter" else None


def setup(app: Sphinx) -> None:
    """Write equations as MathML, which browsers draw without a script from another host."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    app.add_directive("modules", Modules)
    app.connect("autodoc-process-docstring", _keep_bars)
    app.connect("autodoc-skip-member", _skip_tuple_fields)
