"""Weights that would have to be downloaded."""

from __future__ import annotations

from ViTTransferFunction.Logic.session.feature_estimate import WeightsDownload

DOWNLOAD = WeightsDownload(
    model="dinov2_vits14",
    licence="Apache-2.0",
    homepage="https://github.com/facebookresearch/dinov2",
    url="https://dl.fbaipublicfiles.com/dinov2/dinov2_vits14_pretrain.pth",
    target="/cache/weights/dinov2_vits14_pretrain.pth",
    size_mb=88,
    sha256="b938bf1bc15cd2ec0feacfe3a1bb553fe8ea9ca46a7e1d8d00217f29aef60cd9",
)
