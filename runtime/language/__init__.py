"""The language service: what an editor asks about the text of a graph, as pure functions.

In: a :class:`Model`, which is one version of one file's text with its surroundings, and an offset
in it. Out: plain data (diagnostics, completions, edits). No protocol is known here::

    model = Model("blocks:\n  u: {type: Constnt}\n", Path("g.yaml"))
    diagnose(model)[0].message      # no block type 'Constnt', did you mean 'Constant'?

A file that is being typed hardly ever parses. So there are two readings of it: ``scan`` accepts
anything and says where things stand; ``parse_yaml`` is the loader's own and says what is wrong.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from blocks.library.lazy import door

if TYPE_CHECKING:
    from runtime.language.cards import Card, hover
    from runtime.language.changes import (
        delete_block,
        place_of,
        why_not,
        write_document,
        write_entries,
    )
    from runtime.language.completion import Completion, complete
    from runtime.language.diagnostics import Diagnostic, Related, diagnose
    from runtime.language.fixes import Action, actions
    from runtime.language.formatting import apply_edits, format_edits
    from runtime.language.inlays import Hint, Lens, hints, lenses
    from runtime.language.insertion import Edit
    from runtime.language.isolation import Isolation
    from runtime.language.model import Model
    from runtime.language.names import Place, Project, definition, references, rename, rename_span
    from runtime.language.offers import Offer
    from runtime.language.schemas import json_schema
    from runtime.language.signatures import Signature, signature
    from runtime.language.surroundings import Surroundings
    from runtime.language.symbols import OutlineSymbol, folds, outline
    from runtime.language.text import SourceText, Span
else:
    __getattr__ = door(__name__)
