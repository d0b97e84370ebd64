"""``from spikeblocks.nengo import Simulator``: models of Nengo on the engines of this package."""

try:
    import nengo as _nengo  # noqa: F401
except ImportError:
    from runtime.errors import MissingExtraError

    raise MissingExtraError("running models of Nengo", "nengo") from None

from runtime.nengo import Simulator

__all__ = ["Simulator"]
