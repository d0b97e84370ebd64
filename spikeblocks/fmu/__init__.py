"""Models of other tools: FMUs, as FMI 2.0 and 3.0 describe them; needs the extra ``fmu``.

It offers the blocks ``FMU`` and ``ModelExchangeFMU``, and the target ``fmu`` of ``runtime export``
(``export``). To delete it, remove this folder, tests/bridges/fmu, its lines in pyproject.toml,
docs/fmu.md and what docs/security.md says of FMUs.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from blocks.library.lazy import door

if TYPE_CHECKING:
    from spikeblocks.fmu.cosimulation import FMU
    from spikeblocks.fmu.model_exchange import ModelExchangeFMU
else:
    __getattr__ = door(__name__)

__all__ = ["FMU", "ModelExchangeFMU"]
