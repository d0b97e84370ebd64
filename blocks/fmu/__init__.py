"""Models of other tools: FMUs, as FMI 2.0 and 3.0 describe them; needs the extra ``fmu``."""

from __future__ import annotations

from typing import TYPE_CHECKING

from blocks.lazy import door

if TYPE_CHECKING:
    from blocks.fmu.cosimulation import FMU
    from blocks.fmu.model_exchange import ModelExchangeFMU
else:
    __getattr__ = door(__name__)

__all__ = ["FMU", "ModelExchangeFMU"]
