"""Reading weights files, damaged and malicious ones among them."""

from __future__ import annotations

import io
import itertools
import json
import pickle
import sys
from pathlib import Path

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.weights.state_dict import load_state_dict, tensors_sha256


def _bytes_of(content: object) -> bytes:
    buffer = io.BytesIO()
    torch.save(content, buffer)
    return buffer.getvalue()


TENSORS = {"cls_token": torch.ones(1, 1, 4), "norm.weight": torch.arange(4.0)}
SAVED = _bytes_of(TENSORS)


@pytest.fixture
def a_file(tmp_path: Path) -> Path:
    return tmp_path / "weights.pth"


def test_tensors_come_back_under_their_names(a_file: Path) -> None:
    a_file.write_bytes(SAVED)

    state_dict = load_state_dict(a_file)

    assert list(state_dict) == list(TENSORS)
    assert all(torch.equal(state_dict[name], tensor) for name, tensor in TENSORS.items())


def test_a_file_is_what_it_holds_and_not_what_its_ending_says(tmp_path: Path) -> None:
    path = tmp_path / "weights.safetensors"
    path.write_bytes(SAVED)
    assert list(load_state_dict(path)) == list(TENSORS)
    path.write_bytes(SAVED[:500])
    with pytest.raises(InputError, match="not a weights file"):
        load_state_dict(path)


def test_the_mask_token_is_left_out_and_nothing_else(a_file: Path) -> None:
    a_file.write_bytes(_bytes_of(TENSORS | {"mask_token": torch.zeros(1, 4), "head.weight": torch.zeros(2, 4)}))

    assert list(load_state_dict(a_file)) == ["cls_token", "norm.weight", "head.weight"]


def test_code_in_a_file_is_refused_and_not_run(a_file: Path, tmp_path: Path) -> None:
    trace = tmp_path / "code was run"

    class Malicious:
        def __reduce__(self) -> tuple:
            return Path.touch, (trace,)

    for content in (_bytes_of(TENSORS | {"x": Malicious()}), pickle.dumps(Malicious(), protocol=2)):
        a_file.write_bytes(content)
        with pytest.raises(InputError, match="code, which was not run"):
            load_state_dict(a_file)

    assert not trace.exists()


@pytest.mark.parametrize("content", [b"", b"<!DOCTYPE html><title>Log in</title>", SAVED[: len(SAVED) // 2]])
def test_a_file_that_is_no_checkpoint_is_named(a_file: Path, content: bytes) -> None:
    a_file.write_bytes(content)

    with pytest.raises(InputError, match=r"weights\.pth is not a weights file"):
        load_state_dict(a_file)


@pytest.mark.parametrize(
    ("content", "wrong"),
    [
        (b"", "it is empty"),
        (b"https://example.org/weights.pth\n", "it is text, and begins with 'https://example.org/weights."),
        ("Gewichte für ein Netz".encode(), "it is text, and begins with 'Gewichte für ein Netz'"),
        (b"x" * 27 + "ü".encode(), "it is text, and begins with 'xxx"),
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:0\n", "begins with 'version https://git-lfs"),
    ],
)
def test_of_a_file_that_is_text_or_empty_that_is_told(a_file: Path, content: bytes, wrong: str) -> None:
    a_file.write_bytes(content)
    with pytest.raises(InputError) as refused:
        load_state_dict(a_file)
    assert wrong in str(refused.value)


@settings(max_examples=60, deadline=None)
@given(end=st.integers(0, len(SAVED)), place=st.integers(0, len(SAVED) - 1), value=st.integers(0, 255))
def test_damage_anywhere_is_an_input_error_if_it_is_noticed(
    tmp_path_factory: pytest.TempPathFactory, end: int, place: int, value: int
) -> None:
    damaged = bytearray(SAVED)
    damaged[place] = value
    file = tmp_path_factory.mktemp("damaged") / "weights.pth"
    file.write_bytes(damaged[:end])

    try:
        state_dict = load_state_dict(file)
    except InputError:
        return
    assert all(isinstance(tensor, torch.Tensor) for tensor in state_dict.values())


@pytest.mark.parametrize("content", [torch.zeros(3), [torch.zeros(3)], {}])
def test_something_else_than_named_tensors_is_refused(a_file: Path, content: object) -> None:
    a_file.write_bytes(_bytes_of(content))

    with pytest.raises(InputError, match="expected a dictionary of named tensors"):
        load_state_dict(a_file)


def test_a_training_checkpoint_is_refused_with_its_entries(a_file: Path) -> None:
    a_file.write_bytes(_bytes_of({"student": TENSORS, "teacher": TENSORS, "epoch": 100}))

    with pytest.raises(InputError, match="student, teacher, epoch"):
        load_state_dict(a_file)


@pytest.mark.parametrize(
    "tensor",
    [
        torch.tensor([1.0, float("nan")]),
        torch.tensor([1.0, float("-inf")]),
        torch.ones(1).expand(10**15),
        torch.eye(3).to_sparse(),
    ],
    ids=["nan", "infinite", "a petabyte of one number", "sparse"],
)
def test_tensors_of_anything_but_finite_numbers_are_refused(a_file: Path, tensor: torch.Tensor) -> None:
    a_file.write_bytes(_bytes_of(TENSORS | {"norm.bias": tensor}))

    with pytest.raises(InputError, match=r"not finite numbers \(in 'norm\.bias'\)|not a weights file"):
        load_state_dict(a_file)


def test_a_lack_of_memory_is_not_taken_for_damage(a_file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def out_of_memory(*_: object, **__: object) -> None:
        raise RuntimeError("DefaultCPUAllocator: can't allocate memory: you tried to allocate 90000000 bytes")

    a_file.write_bytes(SAVED)
    monkeypatch.setattr(torch, "load", out_of_memory)
    with pytest.raises(RuntimeError, match="can't allocate memory"):
        load_state_dict(a_file)


def test_a_missing_file_is_named(a_file: Path) -> None:
    with pytest.raises(InputError, match=r"Cannot read the weights file .*weights\.pth"):
        load_state_dict(a_file)


class TestSafetensors:
    """Against the format's own package."""

    @pytest.fixture
    def saved(self) -> bytes:
        tensors = TENSORS | {
            "half": torch.ones(2, 3).half(),
            "bf16": torch.tensor([0.1, -2.0]).bfloat16(),
            "scalar": torch.ones(()),
        }
        return pytest.importorskip("safetensors.torch").save(tensors, metadata={"format": "pt"})

    def test_its_tensors_come_back_whatever_the_files_name(self, a_file: Path, saved: bytes) -> None:
        a_file.write_bytes(saved)

        state_dict = load_state_dict(a_file)

        expected = sys.modules["safetensors.torch"].load(saved)
        assert state_dict.keys() == expected.keys()
        for name, tensor in expected.items():
            torch.testing.assert_close(state_dict[name], tensor, atol=0, rtol=0)

    def test_damage_anywhere_is_an_input_error_if_it_is_noticed(self, a_file: Path, saved: bytes) -> None:
        noticed = 0
        for place, value in itertools.product(range(len(saved)), (0, ord("9"), ord("-"), 255)):
            damaged = bytearray(saved)
            damaged[place] = value
            a_file.write_bytes(damaged[: len(saved) - place % 3])
            try:
                load_state_dict(a_file)
            except InputError:
                noticed += 1
        assert noticed > len(saved)

    @pytest.mark.parametrize(
        ("shape", "offsets"),
        [([3], (0, 16)), ([5], (0, 16)), ([4], (-4, 12)), ([4], (8, 24)), ([0], (0, 0)), ([-4], (16, 0))],
        ids=["fewer numbers than bytes", "more", "before the first byte", "beyond the last", "none", "a negative number"],
    )
    def test_a_tensor_of_other_bytes_than_its_own_is_refused(
        self, a_file: Path, shape: list[int], offsets: tuple[int, int]
    ) -> None:
        header = json.dumps({"norm.bias": {"dtype": "F32", "shape": shape, "data_offsets": offsets}}).encode()
        a_file.write_bytes(len(header).to_bytes(8, "little") + header + bytes(16))

        with pytest.raises(InputError, match=r"not a weights file.*norm\.bias does not lie where the header says"):
            load_state_dict(a_file)

    def test_whole_numbers_are_refused(self, a_file: Path, saved: bytes) -> None:
        a_file.write_bytes(saved.replace(b'"BF16"', b'"I16" '))

        with pytest.raises(
            InputError, match=r"weights\.pth is not a weights file.*bf16 is of type I16, expected one of F32, F16, BF16"
        ):
            load_state_dict(a_file)


class TestTensorsSha256:
    def test_it_does_not_depend_on_the_order(self) -> None:
        a, b = torch.zeros(2), torch.ones(3)

        assert tensors_sha256({"a": a, "b": b}) == tensors_sha256({"b": b, "a": a})

    @pytest.mark.parametrize(
        "other",
        [
            {"b": torch.zeros(2, 3)},
            {"a": torch.zeros(3, 2)},
            {"a": torch.tensor([[0, 0, 0], [0, 0, 1e-45]])},
            {"a": torch.zeros(2, 3), "b": torch.zeros(0)},
        ],
        ids=["name", "shape", "bit", "count"],
    )
    def test_it_differs_where_one_tensor_does(self, other: dict[str, torch.Tensor]) -> None:
        assert tensors_sha256(other) != tensors_sha256({"a": torch.zeros(2, 3)})
