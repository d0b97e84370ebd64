"""The language server through a real client, over the pipes of the console script."""

from __future__ import annotations

import sys
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest
import pytest_lsp
from lsprotocol import types
from pytest_lsp import (
    ClientServerConfig,
    LanguageClient,
    client_capabilities,
    make_test_lsp_client,
)

from runtime.language import apply_edits
from runtime.language.text import SourceText, Span
from tests.runtime.language.texts import CASE_C, GRAPHS, MARK, chain

SCRIPT = str(Path(sys.executable).parent / "runtime")
SMALL = """graph: small
run: {dt: 0.1, until: 1.0}
blocks:
  a: {type: Constant, value: 1.0}
  b: {type: Gain, gain: 2.0}   # 🙂 twice
wires:
  b: {input: a.value}
probes:
  p: b.out
metrics:
  m: {kind: mean_abs, of: b.out}
"""


def make_client() -> LanguageClient:
    """A client that accepts registrations, and keeps diagnostics with the version they are for."""
    client = make_test_lsp_client()
    client.versions = {}  # type: ignore[attr-defined]
    features = client.protocol.fm.features
    stored = features[types.TEXT_DOCUMENT_PUBLISH_DIAGNOSTICS]

    def publish(params: types.PublishDiagnosticsParams) -> None:
        stored(params)
        client.versions[params.uri] = params.version  # type: ignore[attr-defined]

    features[types.TEXT_DOCUMENT_PUBLISH_DIAGNOSTICS] = publish

    @client.feature(types.CLIENT_REGISTER_CAPABILITY)
    def register(params: types.RegistrationParams) -> None:
        return None

    return client


@pytest_lsp.fixture(
    scope="module",
    config=ClientServerConfig([SCRIPT, "lsp", "--stdio"], client_factory=make_client),
)
async def client(lsp_client: LanguageClient) -> AsyncIterator[None]:
    """An editor with all that Visual Studio Code can do."""
    capabilities = client_capabilities("visual-studio-code")
    await lsp_client.initialize_session(
        types.InitializeParams(capabilities=capabilities, root_uri=GRAPHS.as_uri())
    )
    yield
    await lsp_client.shutdown_session()


pytestmark = pytest.mark.asyncio(loop_scope="module")


class Editor:
    """One open text."""

    opened = 0

    def __init__(self, client: LanguageClient, text: str, path: Path = CASE_C) -> None:
        self.client, self.text, self.uri = client, text, path.as_uri()
        self.version = 1
        client.versions.pop(self.uri, None)  # type: ignore[attr-defined]
        document = types.TextDocumentItem(self.uri, "yaml", 1, text)
        client.text_document_did_open(types.DidOpenTextDocumentParams(document))

    @property
    def document(self) -> types.TextDocumentIdentifier:
        return types.TextDocumentIdentifier(self.uri)

    def at(self, marked: str) -> types.Position:
        offset = self.text.index(marked.replace(MARK, "")) + marked.index(MARK)
        return types.Position(*SourceText(self.text).position(offset))

    def where(self, marked: str) -> dict[str, Any]:
        return {"text_document": self.document, "position": self.at(marked)}

    async def edit(self, old: str, new: str) -> list[types.Diagnostic]:
        """Change one place, as an editor sends it; the diagnostics that follow."""
        start = self.text.index(old)
        text = SourceText(self.text)
        place = types.Range(
            types.Position(*text.position(start)), types.Position(*text.position(start + len(old)))
        )
        self.text = self.text[:start] + new + self.text[start + len(old) :]
        self.version += 1
        change = types.TextDocumentContentChangePartial(range=place, text=new)
        identifier = types.VersionedTextDocumentIdentifier(self.version, self.uri)
        self.client.text_document_did_change(
            types.DidChangeTextDocumentParams(identifier, [change])
        )
        return await self.diagnostics()

    async def diagnostics(self) -> list[types.Diagnostic]:
        versions: dict[str, int] = self.client.versions  # type: ignore[attr-defined]
        while versions.get(self.uri) != self.version:
            await self.client.wait_for_notification(types.TEXT_DOCUMENT_PUBLISH_DIAGNOSTICS)
        return list(self.client.diagnostics[self.uri])

    async def next_diagnostics(self, before: list[types.Diagnostic]) -> types.Diagnostic:
        """The first of the diagnostics after those, though the text did not change.

        They may be there before anyone waits for them.
        """
        while list(self.client.diagnostics[self.uri]) in ([], before):
            await self.client.wait_for_notification(types.TEXT_DOCUMENT_PUBLISH_DIAGNOSTICS)
        return self.client.diagnostics[self.uri][0]

    async def labels(self, marked: str) -> list[str]:
        found = await self.client.text_document_completion_async(
            types.CompletionParams(**self.where(marked))
        )
        assert isinstance(found, types.CompletionList)
        return [item.label for item in found.items]

    def underlined(self, place: types.Range) -> str:
        return self.text[slice(*self.span(place))]

    def span(self, place: types.Range) -> Span:
        text = SourceText(self.text)
        return Span(
            text.offset(place.start.line, place.start.character),
            text.offset(place.end.line, place.end.character),
        )

    def after(self, edits: list[types.TextEdit]) -> str:
        return apply_edits(self.text, [(self.span(edit.range), edit.new_text) for edit in edits])

    async def close(self) -> None:
        self.client.text_document_did_close(types.DidCloseTextDocumentParams(self.document))


@pytest.fixture
def case_c(client: LanguageClient) -> Editor:
    return Editor(client, CASE_C.read_text(encoding="utf-8"))


async def test_diagnostics_follow_edits(client: LanguageClient, case_c: Editor) -> None:
    assert await case_c.diagnostics() == []
    [found] = await case_c.edit("q: [10", "Q: [10")
    assert found.message == "unknown parameter, did you mean 'q'?"
    assert case_c.underlined(found.range) == "Q"
    assert found.severity == types.DiagnosticSeverity.Error
    assert found.source == "spikeblocks"
    assert await case_c.edit("Q: [10", "q: [10") == []
    broken = await case_c.edit("  lqr: {type: LQR", "  lqr: {type: [LQR")
    assert broken[0].message.startswith("not valid YAML")
    await case_c.close()


async def test_completion_in_a_text_that_does_not_parse(
    client: LanguageClient, case_c: Editor
) -> None:
    await case_c.edit("lqr: {error: error.state, reference: match.reference}", "lqr: {error: ")
    assert (await case_c.labels("lqr: {error: ¦"))[0] == "error.state"
    await case_c.close()


async def test_completion_items(client: LanguageClient, case_c: Editor) -> None:
    await case_c.edit("lqr: {error: error.state, reference: match.reference}", "lqr: {}")
    found = await client.text_document_completion_async(
        types.CompletionParams(**case_c.where("lqr: {¦}"))
    )
    assert isinstance(found, types.CompletionList)
    item = next(each for each in found.items if each.kind == types.CompletionItemKind.Snippet)
    assert item.insert_text_format == types.InsertTextFormat.Snippet
    assert isinstance(item.text_edit, types.TextEdit)
    assert item.text_edit.new_text.startswith("error: ${1:error.state}, reference: ${2|")
    assert [each.sort_text for each in found.items] == sorted(
        each.sort_text or "" for each in found.items
    )
    await case_c.close()


async def test_hover_and_signature(client: LanguageClient, case_c: Editor) -> None:
    found = await client.text_document_hover_async(
        types.HoverParams(**case_c.where("lqr: {error: error.st¦ate"))
    )
    assert found is not None
    assert isinstance(found.contents, types.MarkupContent)
    assert "TrackingState, 20 Hz" in found.contents.value
    shown = await client.text_document_signature_help_async(
        types.SignatureHelpParams(**case_c.where("lqr: {error: ¦error.state"))
    )
    assert shown is not None
    assert shown.signatures[0].label == "lqr(error: TrackingState, reference: Pose)"
    assert shown.active_parameter == 0
    await case_c.close()


async def test_definition_references_and_highlights(client: LanguageClient, case_c: Editor) -> None:
    found = await client.text_document_definition_async(
        types.DefinitionParams(**case_c.where("rate¦_v: 1.0e-8"))
    )
    assert isinstance(found, list)
    assert isinstance(found[0], types.Location)
    assert found[0].uri == (GRAPHS / "parts" / "adaptive_snn.yaml").as_uri()
    where = case_c.where("  lq¦r: {type")
    context = types.ReferenceContext(include_declaration=False)
    uses = await client.text_document_references_async(
        types.ReferenceParams(context=context, **where)
    )
    assert uses is not None
    assert {Path(place.uri).name for place in uses} == {
        *("wall_following.yaml", "walls.yaml", "walls_robust.yaml", "robust.yaml"),
        *("line_actuator_failure.yaml", "line.yaml", "line_robust.yaml"),
        *("sine_estimation_error.yaml", "sine.yaml", "sine_robust.yaml"),
    }
    marks = await client.text_document_document_highlight_async(
        types.DocumentHighlightParams(**case_c.where("  lq¦r: {type"))
    )
    assert {case_c.underlined(mark.range) for mark in marks or []} == {"lqr"}
    await case_c.close()


async def test_rename(client: LanguageClient, case_c: Editor) -> None:
    place = await client.text_document_prepare_rename_async(
        types.PrepareRenameParams(**case_c.where("  lq¦r: {type"))
    )
    assert isinstance(place, types.Range)
    assert case_c.underlined(place) == "lqr"
    where = case_c.where("  lq¦r: {type")
    edit = await client.text_document_rename_async(types.RenameParams(new_name="steering", **where))
    assert edit is not None
    assert edit.changes is not None
    result = case_c.after(list(edit.changes[case_c.uri]))
    assert "steering: {type: LQR" in result
    assert "lqr" not in result.replace("# lqr", "")
    with pytest.raises(Exception, match="there is a block 'error' already"):
        await client.text_document_rename_async(types.RenameParams(new_name="error", **where))
    await case_c.close()


async def test_code_actions(client: LanguageClient, case_c: Editor) -> None:
    [found] = await case_c.edit("q: [10", "Q: [10")
    offered = await client.text_document_code_action_async(
        types.CodeActionParams(case_c.document, found.range, types.CodeActionContext([found]))
    )
    assert offered is not None
    action = offered[0]
    assert isinstance(action, types.CodeAction)
    assert action.title == "Replace by 'q'"
    assert action.is_preferred
    assert [each.message for each in action.diagnostics or []] == [found.message]
    assert action.edit is not None
    assert action.edit.changes is not None
    assert "q: [10" in case_c.after(list(action.edit.changes[case_c.uri]))
    await case_c.close()


async def test_outline_folding_formatting_hints_and_lenses(
    client: LanguageClient, case_c: Editor
) -> None:
    symbols = await client.text_document_document_symbol_async(
        types.DocumentSymbolParams(case_c.document)
    )
    assert [symbol.name for symbol in symbols or []][:2] == ["graph", "run"]
    folds = await client.text_document_folding_range_async(
        types.FoldingRangeParams(case_c.document)
    )
    assert any(fold.kind == types.FoldingRangeKind.Comment for fold in folds or [])
    options = types.FormattingOptions(2, True)
    parameters = types.DocumentFormattingParams(case_c.document, options)
    assert not await client.text_document_formatting_async(parameters)
    await case_c.edit("search: {input: explore", "search: {input:   explore")
    edits = await client.text_document_formatting_async(parameters)
    assert case_c.after(list(edits or [])) == CASE_C.read_text(encoding="utf-8")
    whole = types.Range(types.Position(0, 0), types.Position(200, 0))
    hints = await client.text_document_inlay_hint_async(
        types.InlayHintParams(case_c.document, whole)
    )
    assert ": TrackingState, 20 Hz" in {hint.label for hint in hints or []}
    lenses = await client.text_document_code_lens_async(types.CodeLensParams(case_c.document))
    commands = {lens.command.command for lens in lenses or [] if lens.command}
    assert commands == {"spikeblocks.run", "spikeblocks.showDiagram", "spikeblocks.compare"}
    await case_c.close()


async def test_the_diagram_is_that_of_the_unsaved_text(
    client: LanguageClient, tmp_path: Path
) -> None:
    editor = Editor(client, SMALL, tmp_path / "small.yaml")
    await editor.edit("  b: {type", "  c: {type: Constant, value: 2}\n  b: {type")
    asked = types.ExecuteCommandParams("spikeblocks.diagram", [editor.uri])
    found: Any = await client.workspace_execute_command_async(asked)
    assert "<svg" in _get(found, "svg")
    assert ">c<" in _get(found, "svg")
    await editor.edit("gain: 2.0", "gian: 2.0")
    found = await client.workspace_execute_command_async(asked)
    assert "did you mean 'gain'?" in _get(found, "error")
    await editor.close()


def _get(found: Any, key: str) -> str:
    return str(found[key] if isinstance(found, dict) else getattr(found, key))


@pytest.mark.slow
async def test_a_graph_is_run(client: LanguageClient, tmp_path: Path) -> None:
    path = tmp_path / "small.yaml"
    path.write_text(SMALL, encoding="utf-8")
    editor = Editor(client, SMALL, path)
    found: Any = await client.workspace_execute_command_async(
        types.ExecuteCommandParams("spikeblocks.run", [editor.uri])
    )
    assert int(_get(found, "code")) == 0
    assert (tmp_path / "runs" / "small" / "latest").exists()
    await editor.close()


async def test_positions_count_utf_16(client: LanguageClient, tmp_path: Path) -> None:
    text = SMALL.replace("graph: small", "graph: '🙂🙂'").replace(
        "b: {type: Gain, gain: 2.0}", "b: {type: Gain, gain: 2.0, '🙂': 1}"
    )
    editor = Editor(client, text, tmp_path / "wide.yaml")
    [found] = await editor.diagnostics()
    assert editor.underlined(found.range) == "'🙂'"
    assert found.range.end.character - found.range.start.character == 4
    await editor.close()


async def test_another_open_text_takes_the_place_of_its_file(
    client: LanguageClient, tmp_path: Path
) -> None:
    (tmp_path / "base.yaml").write_text(SMALL, encoding="utf-8")
    top = Editor(client, "extends: base.yaml\ngraph: top\n", tmp_path / "top.yaml")
    assert await top.diagnostics() == []
    base = Editor(client, SMALL, tmp_path / "base.yaml")
    await base.diagnostics()
    await base.edit("gain: 2.0", "gian: 2.0")
    found = await top.next_diagnostics([])
    assert "base.yaml:5:" in found.message
    assert top.underlined(found.range) == "base.yaml"
    await top.close()
    await base.close()


async def test_other_yaml_is_left_alone(client: LanguageClient, tmp_path: Path) -> None:
    text = "services:\n  web: {image: x}\nversion: 3\n"
    editor = Editor(client, text, tmp_path / "compose.yaml")
    assert await editor.diagnostics() == []
    assert await editor.labels("services:¦") == []
    await editor.close()


async def test_two_thousand_blocks(client: LanguageClient, tmp_path: Path) -> None:
    editor = Editor(client, chain(2000), tmp_path / "big.yaml")
    assert await editor.diagnostics() == []
    found = await editor.edit("b777: {input: b776.out}", "b777: {input: b77.}")
    assert "b77" in found[0].message
    assert "b77.out" in await editor.labels("b777: {input: b77.¦}")
    await editor.close()


async def test_a_module_is_imported_apart_and_its_problem_comes_later(
    client: LanguageClient, tmp_path: Path
) -> None:
    (tmp_path / "own.py").write_text("import time\ntime.sleep(0.6)\n1 / 0\n", encoding="utf-8")
    text = SMALL.replace("type: Gain,", "type: Mine, module: own.py,")
    editor = Editor(client, text, tmp_path / "own.yaml")
    found = await editor.diagnostics()
    while "ZeroDivisionError" not in found[0].message:
        found = [await editor.next_diagnostics(found)]
    assert editor.underlined(found[0].range) == "own.py"
    await editor.close()


async def test_requests_about_strange_places_are_answered(
    client: LanguageClient, case_c: Editor
) -> None:
    for line, character in [(0, 0), (10_000, 0), (3, 10_000), (101, 0)]:
        where: dict[str, Any] = {
            "text_document": case_c.document,
            "position": types.Position(line, character),
        }
        await client.text_document_hover_async(types.HoverParams(**where))
        await client.text_document_completion_async(types.CompletionParams(**where))
        await client.text_document_definition_async(types.DefinitionParams(**where))
    await case_c.close()
