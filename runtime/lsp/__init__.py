"""The language server: the Language Server Protocol in front of :mod:`runtime.language` (pygls).

A bridge: its door is the verb ``lsp``, and nothing but the table of verbs names it.
"""

from runtime.lsp.verb import EXAMPLES, GROUP, HELP, add, run
