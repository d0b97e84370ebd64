"""The studio: a page in the browser that shows a graph run, and changes it by hand.

It offers the verb ``studio`` (extra ``studio``). To delete it, remove this folder,
tests/bridges/studio, editors/studio (which builds the text editor), docs/studio.md and its lines in
pyproject.toml; nothing else names it.

    page (browser)  ─ websocket ─  server, room (asyncio)  ─ pipe ─  worker (one session)
                                   desk (text, language; a thread)
"""

from spikeblocks.studio.verb import EXAMPLES, GROUP, HELP, add, run
