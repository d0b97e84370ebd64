"""The requests of an editor about a document."""

from __future__ import annotations

from typing import Protocol

from lsprotocol import types
from pygls.exceptions import JsonRpcInvalidParams
from pygls.lsp.server import LanguageServer

from runtime.errors import UsageError
from runtime.language import (
    Model,
    Span,
    actions,
    complete,
    definition,
    folds,
    format_edits,
    hints,
    hover,
    lenses,
    outline,
    references,
    rename,
    rename_span,
    signature,
)
from spikeblocks.lsp.commands import COMMANDS
from spikeblocks.lsp.convert import Converter, markdown
from spikeblocks.lsp.session import Session

TRIGGERS = [":", " ", ".", "$", "{", "[", ",", "/"]


def add_requests(server: LanguageServer, session: Session) -> None:
    """Make a server answer."""
    _add_writing(server, session)
    _add_edits(server, session)
    _add_names(server, session)
    _add_views(server, session)


class _Placed(Protocol):
    """What all requests about a position have."""

    text_document: types.TextDocumentIdentifier
    position: types.Position


def _at(session: Session, params: _Placed) -> tuple[Model, int]:
    position = params.position
    return session.place(params.text_document.uri, position.line, position.character)


def _snippets(server: LanguageServer) -> bool:
    """Whether the editor understands snippets."""
    text = server.client_capabilities.text_document
    item = text.completion.completion_item if text and text.completion else None
    return bool(item and item.snippet_support)


def _add_writing(server: LanguageServer, session: Session) -> None:
    converter = Converter(session)

    @server.feature(
        types.TEXT_DOCUMENT_COMPLETION, types.CompletionOptions(trigger_characters=TRIGGERS)
    )
    def completion(ls: LanguageServer, params: types.CompletionParams) -> types.CompletionList:
        model, offset = _at(session, params)
        if not model.is_ours or model.refusal:
            return types.CompletionList(is_incomplete=False, items=[])
        return converter.completion(model, complete(model, offset), _snippets(ls))

    @server.feature(types.TEXT_DOCUMENT_HOVER)
    def card(ls: LanguageServer, params: types.HoverParams) -> types.Hover | None:
        model, offset = _at(session, params)
        found = hover(model, offset) if model.is_ours else None
        if found is None:
            return None
        return types.Hover(markdown(found.markdown), converter.range(model.text, found.span))

    @server.feature(
        types.TEXT_DOCUMENT_SIGNATURE_HELP,
        types.SignatureHelpOptions(trigger_characters=["{", ",", ":"]),
    )
    def signature_help(
        ls: LanguageServer, params: types.SignatureHelpParams
    ) -> types.SignatureHelp | None:
        model, offset = _at(session, params)
        found = signature(model, offset) if model.is_ours else None
        if found is None:
            return None
        parameters = [
            types.ParameterInformation(label, markdown(doc) if doc else None)
            for label, doc in found.parameters
        ]
        shown = types.SignatureInformation(found.label, None, parameters)
        # Past the last parameter none is highlighted.
        active = len(parameters) if found.active is None else found.active
        return types.SignatureHelp([shown], active_signature=0, active_parameter=active)


def _add_edits(server: LanguageServer, session: Session) -> None:
    converter = Converter(session)

    @server.feature(types.TEXT_DOCUMENT_CODE_ACTION)
    def code_actions(ls: LanguageServer, params: types.CodeActionParams) -> list[types.CodeAction]:
        model, span = _range(session, params.text_document.uri, params.range)
        if not model.is_ours:
            return []
        shown = params.context.diagnostics
        return [converter.action(model, found, shown) for found in actions(model, span)]

    @server.feature(types.TEXT_DOCUMENT_FORMATTING)
    def formatting(
        ls: LanguageServer, params: types.DocumentFormattingParams
    ) -> list[types.TextEdit]:
        model = session.model(params.text_document.uri)
        return converter.edits(model, format_edits(model) if model.is_ours else [])


def _range(session: Session, uri: str, asked: types.Range) -> tuple[Model, Span]:
    model = session.model(uri)
    start, end = asked.start, asked.end
    return model, session.span(model, (start.line, start.character), (end.line, end.character))


def _add_names(server: LanguageServer, session: Session) -> None:
    converter = Converter(session)

    @server.feature(types.TEXT_DOCUMENT_DEFINITION)
    def go_to(ls: LanguageServer, params: types.DefinitionParams) -> list[types.Location]:
        model, offset = _at(session, params)
        found = definition(model, offset, session.project(model)) if model.is_ours else []
        return [converter.location(model, place) for place in found]

    @server.feature(types.TEXT_DOCUMENT_REFERENCES)
    def find(ls: LanguageServer, params: types.ReferenceParams) -> list[types.Location]:
        model, offset = _at(session, params)
        project = session.project(model)
        found = references(model, offset, project) if model.is_ours else []
        if not params.context.include_declaration:
            defined = definition(model, offset, project)
            found = [place for place in found if place not in defined]
        return [converter.location(model, place) for place in found]

    @server.feature(types.TEXT_DOCUMENT_DOCUMENT_HIGHLIGHT)
    def highlight(
        ls: LanguageServer, params: types.DocumentHighlightParams
    ) -> list[types.DocumentHighlight]:
        model, offset = _at(session, params)
        found = references(model, offset, session.project(model)) if model.is_ours else []
        own = [place.span for place in found if place.path.resolve() == model.path.resolve()]
        return [types.DocumentHighlight(converter.range(model.text, span)) for span in own]

    @server.feature(types.TEXT_DOCUMENT_PREPARE_RENAME)
    def prepare(ls: LanguageServer, params: types.PrepareRenameParams) -> types.Range | None:
        model, offset = _at(session, params)
        span = rename_span(model, offset) if model.is_ours else None
        return None if span is None else converter.range(model.text, span)

    @server.feature(types.TEXT_DOCUMENT_RENAME, types.RenameOptions(prepare_provider=True))
    def change(ls: LanguageServer, params: types.RenameParams) -> types.WorkspaceEdit:
        model, offset = _at(session, params)
        project = session.project(model)
        within = session.files(model)
        try:
            edits = rename(model, offset, params.new_name, project, [model.path, *within])
        except UsageError as error:
            raise JsonRpcInvalidParams(str(error)) from None
        return converter.workspace_edit(model, edits)


def _add_views(server: LanguageServer, session: Session) -> None:
    converter = Converter(session)

    @server.feature(types.TEXT_DOCUMENT_DOCUMENT_SYMBOL)
    def symbols(
        ls: LanguageServer, params: types.DocumentSymbolParams
    ) -> list[types.DocumentSymbol]:
        model = session.model(params.text_document.uri)
        return [converter.symbol(model, found) for found in outline(model)]

    @server.feature(types.TEXT_DOCUMENT_FOLDING_RANGE)
    def folding(ls: LanguageServer, params: types.FoldingRangeParams) -> list[types.FoldingRange]:
        model = session.model(params.text_document.uri)
        comment = types.FoldingRangeKind.Comment
        return [
            types.FoldingRange(first, last, kind=comment if is_comment else None)
            for first, last, is_comment in folds(model)
        ]

    @server.feature(types.TEXT_DOCUMENT_INLAY_HINT)
    def inlay(ls: LanguageServer, params: types.InlayHintParams) -> list[types.InlayHint]:
        model, span = _range(session, params.text_document.uri, params.range)
        found = hints(model, span) if model.is_ours else []
        return [
            types.InlayHint(
                types.Position(*model.text.position(hint.offset, session.encoding)),
                hint.label,
                types.InlayHintKind.Type if hint.is_type else types.InlayHintKind.Parameter,
            )
            for hint in found
        ]

    @server.feature(types.TEXT_DOCUMENT_CODE_LENS)
    def code_lenses(ls: LanguageServer, params: types.CodeLensParams) -> list[types.CodeLens]:
        uri = params.text_document.uri
        model = session.model(uri)
        return [
            types.CodeLens(
                converter.range(model.text, lens.span),
                types.Command(lens.title, COMMANDS[lens.command], arguments=[uri, lens.block]),
            )
            for lens in (lenses(model) if model.is_ours else [])
        ]
