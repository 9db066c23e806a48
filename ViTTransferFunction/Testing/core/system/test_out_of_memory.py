"""Memory that runs out is recognised, whoever says so."""

from __future__ import annotations

import errno
from collections.abc import Callable

import numpy as np
import pytest
import torch

from ViTTransferFunction.Logic.core.system.out_of_memory import is_out_of_memory

TOO_MUCH = 2**55


@pytest.mark.parametrize("allocate", [lambda: np.empty(TOO_MUCH, np.uint8), lambda: torch.empty(TOO_MUCH, dtype=torch.uint8)])
def test_what_numpy_and_pytorch_raise_is_recognised(allocate: Callable[[], object]) -> None:
    with pytest.raises((MemoryError, RuntimeError)) as caught:
        allocate()
    assert is_out_of_memory(caught.value)


@pytest.mark.parametrize(
    "error",
    [
        MemoryError(),
        OSError(errno.ENOMEM, "Cannot allocate memory"),
        RuntimeError("CUDA out of memory. Tried to allocate 2 GiB"),
        RuntimeError("CUDA error: CUBLAS_STATUS_ALLOC_FAILED when calling `cublasCreate(handle)`"),
        RuntimeError("Exception thrown in SimpleITK ImageFileReader_Execute: Failed to allocate memory for image."),
        ImportError("libtorch_cpu.so: cannot map: Cannot allocate memory"),
    ],
)
def test_what_others_raise_is_recognised(error: Exception) -> None:
    assert is_out_of_memory(error)


def test_what_windows_says_in_german_is_recognised_by_its_number() -> None:
    error = OSError(errno.EINVAL, "Die Auslagerungsdatei ist zu klein, um diesen Vorgang durchzuführen. Error loading c10.dll")
    assert not is_out_of_memory(error)
    error.winerror = 1455  # type: ignore[attr-defined,unused-ignore]
    assert is_out_of_memory(error)


@pytest.mark.parametrize("error", [ValueError("shapes do not fit"), OSError(errno.ENOENT, "No such file"), RuntimeError()])
def test_other_errors_are_not_taken_for_it(error: Exception) -> None:
    assert not is_out_of_memory(error)
