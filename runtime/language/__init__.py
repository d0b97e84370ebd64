"""The language service: what an editor asks about the text of a graph, as pure functions.

A :class:`Model` is one version of one text with its surroundings; every function takes a model and
an offset. No protocol is known here: ``runtime lsp`` speaks one.
"""

from runtime.language.completion import Completion, complete
from runtime.language.diagnostics import Diagnostic, Related, diagnose
from runtime.language.hover import Card, hover
from runtime.language.model import Model, Surroundings
from runtime.language.offers import Offer
from runtime.language.signature import Signature, signature
from runtime.language.text import Span, Text

__all__ = [
    "Card",
    "Completion",
    "Diagnostic",
    "Model",
    "Offer",
    "Related",
    "Signature",
    "Span",
    "Surroundings",
    "Text",
    "complete",
    "diagnose",
    "hover",
    "signature",
]
