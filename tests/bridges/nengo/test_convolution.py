"""Convolutional transforms as matrices, against what nengo computes."""

from __future__ import annotations

from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

nengo = pytest.importorskip("nengo")

from runtime.errors import UsageError  # noqa: E402
from spikeblocks.nengo.convolution import convolution_matrix  # noqa: E402
from spikeblocks.nengo.importing import import_file, run_both  # noqa: E402

LAYERS = """
import nengo, numpy as np
with nengo.Network(seed=2) as model:
    image = nengo.Node(lambda t: np.sin(40 * t + np.arange(36)))
    first = nengo.Convolution(2, (6, 6, 1), init=nengo.dists.Gaussian(0, 0.3))
    given = {"gain": nengo.dists.Choice([10]), "bias": nengo.dists.Choice([1])}
    a = nengo.Ensemble(first.output_shape.size, 1, **given)
    second = nengo.Convolution(3, first.output_shape, strides=(2, 2), padding="same",
                               init=nengo.dists.Gaussian(0, 0.01))
    b = nengo.Ensemble(second.output_shape.size, 1, neuron_type=nengo.LIFRate(), **given)
    nengo.Connection(image, a.neurons, transform=first, synapse=None)
    nengo.Connection(a.neurons, b.neurons, transform=second, synapse=0.01)
    spikes, rates = nengo.Probe(a.neurons), nengo.Probe(b.neurons)
"""


@pytest.mark.parametrize("shape", [(7,), (6, 5)])
@pytest.mark.parametrize("padding", ["same", "valid"])
@pytest.mark.parametrize("kind", ["Convolution", "ConvolutionTranspose", "groups"])
def test_a_matrix_multiplies_as_the_transform_does(
    shape: tuple[int, ...], padding: str, kind: str
) -> None:
    rng = np.random.RandomState(0)
    groups: dict[str, Any] = {"groups": 2} if kind == "groups" else {}
    cls = getattr(nengo, "Convolution" if groups else kind)
    for size, stride, is_last in product((2, 3), (1, 2), (True, False)):
        transform = cls(
            6,
            (*shape, 4) if is_last else (4, *shape),
            kernel_size=(size,) * len(shape),
            strides=(stride,) * len(shape),
            padding=padding,
            channels_last=is_last,
            init=nengo.dists.Gaussian(0, 1),
            **groups,
        )
        with nengo.Network(seed=1) as network:
            signal = nengo.Node(rng.randn(transform.size_in))
            result = nengo.Node(size_in=transform.size_out)
            connection = nengo.Connection(signal, result, transform=transform, synapse=None)
            probe = nengo.Probe(result)
        with nengo.Simulator(network, progress_bar=False) as simulator:
            simulator.run_steps(1)
        matrix = convolution_matrix(transform, simulator.data[connection].weights)
        assert matrix @ signal.output == pytest.approx(simulator.data[probe][-1], abs=1e-12)


def test_layers_of_a_model_are_imported(tmp_path: Path) -> None:
    (tmp_path / "model.py").write_text(LAYERS)
    imported = import_file(str(tmp_path / "model.py"), tmp_path / "my.yaml")
    ours, theirs = run_both(imported, 0.1)
    assert ours.keys() == theirs.keys()
    assert ours["spikes of a"].any()
    for name, values in theirs.items():
        np.testing.assert_allclose(ours[name], values, atol=1e-9, err_msg=name)


def test_a_layer_that_is_too_large_says_how_large_it_is(tmp_path: Path) -> None:
    """Two layers of a network for images; before, 6.4 GB were taken without a word."""
    text = LAYERS.replace("(3, first", "(64, first").replace("strides=(2, 2), ", "")
    text = text.replace("(2, (6, 6, 1)", "(32, (28, 28, 1)").replace("arange(36)", "arange(784)")
    (tmp_path / "model.py").write_text(text)
    with pytest.raises(UsageError, match=r"matrix of 43264 x 43264, 13\.9 GiB; at most 1 GiB is"):
        import_file(str(tmp_path / "model.py"), tmp_path / "my.yaml")
