"""Arrays as tensors and back, with a PyTorch that knows this NumPy and with one that does not."""

from __future__ import annotations

import gc

import numpy as np
import pytest
import torch

from ViTTransferFunction.Logic.core.volumes import torch_arrays
from ViTTransferFunction.Logic.core.volumes.torch_arrays import array_of, dtype_of, tensor_of

TYPES = ["bool", "uint8", "int8", "int16", "int32", "int64", "float16", "float32", "float64"]


@pytest.fixture(autouse=True, params=[True, False], ids=["same NumPy", "another NumPy"])
def knows_numpy(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> bool:
    if not request.param:
        monkeypatch.setattr(torch_arrays, "pytorch_knows_numpy", lambda: False)
    return request.param


@pytest.mark.parametrize("name", TYPES)
def test_there_and_back_it_is_the_same_memory(name: str) -> None:
    array = np.arange(24).reshape(2, 3, 4).astype(name)
    tensor = tensor_of(array)
    back = array_of(tensor)
    assert (str(tensor.dtype), back.dtype, dtype_of(tensor.dtype)) == (f"torch.{name}", array.dtype, array.dtype)
    np.testing.assert_array_equal(back, array)
    tensor[0, 0, 0] = 1
    back[1, 2, 3] = 0
    assert (array[0, 0, 0], array[1, 2, 3]) == (1, 0)


def test_parts_keep_their_strides() -> None:
    array = np.arange(60.0).reshape(3, 4, 5)
    tensor = tensor_of(array[::2, 1:, 3])
    np.testing.assert_array_equal(array_of(tensor), array[::2, 1:, 3])
    np.testing.assert_array_equal(array_of(tensor.T), array[::2, 1:, 3].T)


@pytest.mark.parametrize("shape", [(), (0,), (0, 3), (1, 0, 2)])
def test_numbers_and_nothing_go_as_well(shape: tuple[int, ...]) -> None:
    array = np.full(shape, 7.0, np.float32)
    there_and_back = array_of(tensor_of(array))
    assert (there_and_back.shape, there_and_back.dtype) == (shape, np.float32)
    np.testing.assert_array_equal(there_and_back, array)


def test_the_memory_lasts_as_long_as_the_array() -> None:
    array = array_of(torch.arange(100_000))
    gc.collect()
    torch.zeros(100_000, dtype=torch.int64)
    np.testing.assert_array_equal(array, np.arange(100_000))


def test_strides_below_0_are_refused() -> None:
    with pytest.raises(ValueError, match="strid"):
        tensor_of(np.arange(6.0)[::-1])


@pytest.mark.filterwarnings("ignore:The given NumPy array is not writable")
def test_an_array_that_may_not_be_written_is_read() -> None:
    array = np.arange(6.0)
    array.flags.writeable = False
    np.testing.assert_array_equal(array_of(tensor_of(array)), array)


@pytest.mark.parametrize("name", ["uint16", "uint32", "uint64"])
def test_a_type_that_an_older_pytorch_lacks_becomes_a_wider_one(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(torch, name, raising=False)
    array = np.array([0, 1, np.iinfo(name).max >> 1], name)
    np.testing.assert_array_equal(array_of(tensor_of(array)), array.astype(np.float64))
