"""What own blocks keep beside their declared states: recorded, put back in place, copied.

``record`` finds all that can change and puts it back into the same objects, ``shared`` finds what
other runs see, too (globals, attributes of classes), and ``copies`` makes a copy for another run.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from blocks.library.lazy import door

if TYPE_CHECKING:
    from runtime.memory.copies import Copier, Run, alike
    from runtime.memory.record import Record, owner_of, same_content
    from runtime.memory.shared import Place, SharedPlaces
else:
    __getattr__ = door(__name__)
