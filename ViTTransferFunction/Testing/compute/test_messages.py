"""Messages arrive through a stream as they were sent, and a stream that ends early is noticed."""

from __future__ import annotations

import io

import numpy as np
import pytest

from ViTTransferFunction.Logic.compute.messages import Message, read_message, write_message


def test_content_and_arrays_arrive_as_they_were_sent() -> None:
    arrays = (
        np.arange(24, dtype=np.int16).reshape(2, 3, 4),
        np.array([[1.5, np.nan], [np.inf, -0.0]], dtype=">f8"),
        np.zeros((0, 3), dtype=np.uint8),
        np.array([True, False]),
        np.arange(20, dtype=np.float32).reshape(4, 5).T,
    )
    stream = io.BytesIO()
    write_message(stream, Message({"what": "Größe", "points": [[1.0, 2.0, 3.0]], "iso": None}, arrays))
    write_message(stream, Message({"second": True}))
    stream.seek(0)
    first, second = read_message(stream), read_message(stream)
    assert first is not None
    assert second is not None
    assert first.content == {"what": "Größe", "points": [[1.0, 2.0, 3.0]], "iso": None}
    for sent, received in zip(arrays, first.arrays, strict=True):
        assert received.dtype == sent.dtype
        np.testing.assert_array_equal(received, sent)
    assert second.content == {"second": True}
    assert read_message(stream) is None


@pytest.mark.parametrize("missing", [1, 10, 200])
def test_an_incomplete_message_is_not_returned(missing: int) -> None:
    stream = io.BytesIO()
    write_message(stream, Message({"what": "maps"}, (np.ones(32),)))
    assert read_message(io.BytesIO(stream.getvalue()[:-missing])) is None
