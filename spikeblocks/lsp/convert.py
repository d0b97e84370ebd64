"""From what the language service finds to what the protocol sends."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from lsprotocol import types

from runtime.language import (
    Action,
    Completion,
    Diagnostic,
    Model,
    Offer,
    OutlineSymbol,
    Place,
    SourceText,
    Span,
)
from spikeblocks.lsp.session import Session

SEVERITIES = {
    "error": types.DiagnosticSeverity.Error,
    "warning": types.DiagnosticSeverity.Warning,
    "information": types.DiagnosticSeverity.Information,
}
ICONS = {
    "section": types.CompletionItemKind.Module,
    "type": types.CompletionItemKind.Class,
    "key": types.CompletionItemKind.Property,
    "value": types.CompletionItemKind.EnumMember,
    "output": types.CompletionItemKind.Field,
    "name": types.CompletionItemKind.Variable,
    "file": types.CompletionItemKind.File,
    "param": types.CompletionItemKind.Constant,
    "snippet": types.CompletionItemKind.Snippet,
}
SYMBOLS = {
    "section": types.SymbolKind.Namespace,
    "block": types.SymbolKind.Object,
    "part": types.SymbolKind.Module,
    "wires": types.SymbolKind.Interface,
    "value": types.SymbolKind.Property,
}
SOURCE = "spikeblocks"


class Converter:
    """Converts spans of texts to the editor's ranges."""

    def __init__(self, session: Session) -> None:
        self.session = session

    def range(self, text: SourceText, span: Span) -> types.Range:
        encoding = self.session.encoding
        start, end = (types.Position(*text.position(at, encoding)) for at in span)
        return types.Range(start, end)

    def location(self, model: Model, place: Place) -> types.Location:
        text = model.text
        if place.path.resolve() != model.path.resolve():
            text = SourceText(model.surroundings.text(place.path) or "")
        return types.Location(self.session.uri(place.path), self.range(text, place.span))

    def diagnostic(self, model: Model, found: Diagnostic) -> types.Diagnostic:
        related = []
        for each in found.related:
            path = Path(each.where.file)
            is_own = path == model.path
            text = model.text if is_own else SourceText(model.surroundings.text(path) or "")
            start = text.at(each.where)
            place = types.Location(self.session.uri(path), self.range(text, Span(start, start)))
            related.append(types.DiagnosticRelatedInformation(place, each.message))
        return types.Diagnostic(
            range=self.range(model.text, found.span),
            message=found.message,
            severity=SEVERITIES[found.severity],
            source=SOURCE,
            related_information=related or None,
        )

    def completion(
        self, model: Model, found: Completion, with_snippets: bool
    ) -> types.CompletionList:
        place = self.range(model.text, found.span)
        offers = [offer for offer in found.offers if with_snippets or not offer.is_snippet]
        items = [self._item(offer, place, number) for number, offer in enumerate(offers)]
        return types.CompletionList(is_incomplete=not found.is_complete, items=items)

    def _item(self, offer: Offer, place: types.Range, number: int) -> types.CompletionItem:
        snippet = types.InsertTextFormat.Snippet
        return types.CompletionItem(
            label=offer.label,
            kind=ICONS[offer.icon],
            detail=offer.detail or None,
            documentation=markdown(offer.doc) if offer.doc else None,
            sort_text=f"{number:04}",
            text_edit=types.TextEdit(place, offer.text),
            insert_text_format=snippet if offer.is_snippet else types.InsertTextFormat.PlainText,
        )

    def symbol(self, model: Model, found: OutlineSymbol) -> types.DocumentSymbol:
        return types.DocumentSymbol(
            name=found.name,
            detail=found.detail or None,
            kind=SYMBOLS[found.kind],
            range=self.range(model.text, found.span),
            selection_range=self.range(model.text, found.name_span),
            children=[self.symbol(model, inner) for inner in found.inner] or None,
        )

    def edits(self, model: Model, edits: Iterable[tuple[Span, str]]) -> list[types.TextEdit]:
        return [types.TextEdit(self.range(model.text, span), new) for span, new in edits]

    def workspace_edit(
        self, model: Model, edits: Mapping[Path, Iterable[tuple[Span, str]]]
    ) -> types.WorkspaceEdit:
        changes: dict[str, list[types.TextEdit]] = {}
        for path, each in edits.items():
            is_own = path.resolve() == model.path.resolve()
            text = model.text if is_own else SourceText(model.surroundings.text(path) or "")
            changes[self.session.uri(path)] = [
                types.TextEdit(self.range(text, span), new) for span, new in each
            ]
        return types.WorkspaceEdit(changes=changes)

    def action(
        self, model: Model, found: Action, shown: Iterable[types.Diagnostic]
    ) -> types.CodeAction:
        answered = []
        if found.fixes is not None:
            own = self.diagnostic(model, found.fixes)
            answered = [d for d in shown if (d.message, d.range) == (own.message, own.range)]
        kind = (
            types.CodeActionKind.QuickFix if found.fixes else types.CodeActionKind.RefactorRewrite
        )
        return types.CodeAction(
            title=found.title,
            kind=kind,
            diagnostics=answered or None,
            is_preferred=found.preferred or None,
            edit=self.workspace_edit(model, {model.path: found.edits}),
        )


def markdown(text: str) -> types.MarkupContent:
    """Markdown as the protocol sends it."""
    return types.MarkupContent(types.MarkupKind.Markdown, text)
