"""The language server: the Language Server Protocol in front of :mod:`runtime.language` (pygls).

It offers the verb ``lsp`` (extra ``editor``). To delete it, remove this folder, tests/bridges/lsp
and its lines in pyproject.toml; nothing else names it.
"""

from spikeblocks.lsp.verb import EXAMPLES, GROUP, HELP, add, run
