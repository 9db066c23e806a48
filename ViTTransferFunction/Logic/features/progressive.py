"""Features that can be used within a second or two, while better ones are computed (coarse to fine)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from ..core.system.progress import Progress, no_progress
from ..core.volumes.volume import Volume
from .cost import FeatureCost, NetworkSpeed, feature_cost
from .extraction import FeatureRun
from .feature_volume import FeatureVolume
from .settings import FeatureSettings

if TYPE_CHECKING:
    from .vision_transformer import VisionTransformer

COARSE_PATCHES = 4_000
"""Of all slices together: about a second on two cores without matrix units."""


def progressive_features(
    volume: Volume,
    network: VisionTransformer,
    settings: FeatureSettings,
    progress: Progress = no_progress,
) -> Iterator[FeatureVolume]:
    """Compute coarse features, then those of the settings.

    Whoever iterates may stop at any time, also by raising `Cancelled` out of `progress`; what was yielded stays usable.

    Args:
        volume: intensities and geometry.
        network: loaded weights on the device to compute on.
        settings: of the final features.
        progress: called with what is done of all features, the coarse ones included.

    Yields:
        Features on the same cells; the last are those of `extract_features`. Coarse ones have a key of their own, and there
        are none where they would see as many patches.
    """
    stages = [FeatureRun(volume, network, of) for of in (_coarse(settings), settings)]
    if stages[0].plan.shape == stages[1].plan.shape:
        del stages[0]
    # By patches and not by slices, of which each has more in the finer stage; those in the background count as well, since
    # which ones these are is not known before a stage begins.
    patches = [math.prod(stage.plan.shape) for stage in stages]
    done, total = 0, sum(patches)
    while stages:
        # While features are used, the sums that they were made of are not in memory.
        yield _features(stages.pop(0), _part_of(progress, done, patches[0], total))
        done += patches.pop(0)


def progressive_cost(volume: Volume, settings: FeatureSettings, network: VisionTransformer, speed: NetworkSpeed) -> FeatureCost:
    """What `progressive_features` takes in all, estimated as by `feature_cost`; without what is made of coarse ones."""
    coarse, fine = (feature_cost(volume, of, network, speed) for of in (_coarse(settings), settings))
    if coarse.shape == fine.shape:
        return fine
    return replace(
        fine,
        tokens=coarse.tokens + fine.tokens,
        seconds=coarse.seconds + fine.seconds,
        peak_bytes=max(coarse.peak_bytes, fine.peak_bytes),
    )


def _part_of(progress: Progress, before: int, steps: int, all_steps: int) -> Progress:
    """Tells `progress` of work that is `steps` of `all_steps`, after `before` of them were done."""

    def in_all(done: int, total: int, what: str) -> None:
        progress(before + steps * done // total, all_steps, what)

    return in_all


def _features(stage: FeatureRun, progress: Progress) -> FeatureVolume:
    stage.run(stage.plan.slices, progress)
    return stage.features()


def _coarse(settings: FeatureSettings) -> FeatureSettings:
    return replace(
        settings, most_patches=COARSE_PATCHES, layer_step=1, every_slice=False, precision="device", merge_background=True
    )
