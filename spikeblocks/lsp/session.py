"""What a server knows between requests: open texts, their models, and the files around them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from pygls.lsp.server import LanguageServer
from pygls.uris import from_fs_path, to_fs_path

from runtime.language import Isolation, Model, Project, Span, Surroundings

SUFFIXES = (".yaml", ".yml")
MAX_FILES = 1_000  # of a folder that are searched for the same names
MAX_SIZE = 2**21  # characters; a larger text would take half a minute to open
SKIPPED = {"node_modules", "runs", "sweeps", "ablations", "__pycache__", "build", "dist"}


def path_of(uri: str) -> Path:
    """The file that a URI stands for; untitled texts get a name in the current folder."""
    found = to_fs_path(uri) if uri.startswith("file:") else None
    if found is not None:
        return Path(found)
    name = "".join(c if c.isalnum() or c in "-_." else "_" for c in uri.rsplit("/", 1)[-1])
    return Path.cwd() / (name or "untitled")


class Session:
    """The open documents of one editor.

    Models are kept until anything changes: a document, a file, or what a module turned out to
    define.
    """

    def __init__(self, server: LanguageServer, isolation: Isolation | None) -> None:
        self.server, self.isolation = server, isolation
        self.epoch = 0
        # What was found of earlier versions of the texts, for those that come after an edit.
        self._earlier = Surroundings()
        self._models: dict[str, tuple[int, Model]] = {}
        self._surroundings: tuple[int, Surroundings] | None = None

    def changed(self) -> None:
        """Something changed: models are made again when they are next asked for."""
        self.epoch += 1

    @property
    def encoding(self) -> str:
        """What the editor counts in a line."""
        return str(getattr(self.server.workspace.position_encoding, "value", "utf-16"))

    @property
    def open(self) -> list[str]:
        """URIs of the open texts."""
        return list(self.server.workspace.text_documents)

    def surroundings(self) -> Surroundings:
        """All open texts, and how modules are read."""
        if self._surroundings is None or self._surroundings[0] != self.epoch:
            texts = self.server.workspace.text_documents
            unsaved = {path_of(uri).resolve(): each.source for uri, each in texts.items()}
            modules = self.isolation.reader if self.isolation is not None else False
            now = replace(self._earlier, unsaved=unsaved, modules=modules, longest=MAX_SIZE)
            self._surroundings = (self.epoch, now)
        return self._surroundings[1]

    def model(self, uri: str) -> Model:
        """The model of an open text, or of a file."""
        known = self._models.get(uri)
        if known is None or known[0] != self.epoch:
            source = self.server.workspace.get_text_document(uri).source
            known = (self.epoch, Model(source, path_of(uri), self.surroundings()))
            if uri in self.server.workspace.text_documents:
                self._models[uri] = known
        return known[1]

    def block_counts(self) -> list[int]:
        """How many blocks each of the open graphs has."""
        networks = [model.network for _, model in self._models.values() if model.is_ours]
        return [len(network.entries) for network in networks if network is not None]

    def closed(self, uri: str) -> None:
        """Forget a document that was closed."""
        self._models.pop(uri, None)
        self.changed()

    def place(self, uri: str, line: int, character: int) -> tuple[Model, int]:
        """The model of a document, and the offset of an editor's position in it."""
        model = self.model(uri)
        return model, model.text.offset(line, character, self.encoding)

    def uri(self, path: Path) -> str:
        """The URI of a file; that of the editor, if it is open."""
        resolved = path.resolve()
        for uri in self.open:
            if path_of(uri).resolve() == resolved:
                return uri
        return from_fs_path(str(path)) or path.as_uri()

    def project(self, model: Model) -> Project:
        """The text and the files in its folder and in the editor's folders."""
        models = {model.path.resolve(): model}
        for uri in self.open:
            models.setdefault(path_of(uri).resolve(), self.model(uri))
        for path in self.files(model):
            if path.resolve() not in models:
                text = model.surroundings.text(path)
                if text is not None:
                    models[path.resolve()] = Model(text, path, model.surroundings)
        return Project(models.values())

    def files(self, model: Model) -> list[Path]:
        """Graph files in the editor's folders, and in that of a document."""
        folders = [path_of(uri) for uri in self.server.workspace.folders]
        found: dict[Path, None] = {}
        for folder in [model.path.parent, *folders]:
            for path in _walk(folder):
                found[path] = None
                if len(found) >= MAX_FILES:
                    return list(found)
        return list(found)

    def span(self, model: Model, start: tuple[int, int], end: tuple[int, int]) -> Span:
        """A range of an editor."""
        text, encoding = model.text, self.encoding
        return Span(text.offset(*start, encoding), text.offset(*end, encoding))


def _walk(folder: Path) -> Iterator[Path]:
    """The graph files in a folder and below it, hidden ones and results left out."""
    folders, seen = [folder], 0
    while folders and seen < MAX_FILES:
        try:
            entries = sorted(folders.pop(0).iterdir())
        except OSError:
            continue
        for path in entries:
            seen += 1
            if path.name.startswith(".") or path.name in SKIPPED:
                continue
            try:
                if path.is_dir() and not path.is_symlink():
                    folders.append(path)
                elif path.suffix in SUFFIXES and path.stat().st_size <= MAX_SIZE:
                    yield path
            except OSError:
                continue
