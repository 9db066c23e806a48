"""The numbers that labels are."""

from __future__ import annotations

import numpy as np
import pytest

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.volumes.label_dtype import label_dtype


@pytest.mark.parametrize(("count", "expected"), [(0, np.uint8), (255, np.uint8), (256, np.uint16), (65535, np.uint16)])
def test_each_structure_has_a_label_that_the_type_holds(count: int, expected: type) -> None:
    assert label_dtype(count) is expected
    assert np.iinfo(label_dtype(count)).max >= count


def test_more_structures_than_labels_are_refused() -> None:
    with pytest.raises(InputError, match="65536 structures; expected 65535 at most"):
        label_dtype(65536)
