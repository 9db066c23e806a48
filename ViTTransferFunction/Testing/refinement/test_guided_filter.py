"""The guided filter against its definition, written out voxel by voxel."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import torch

from ViTTransferFunction.Logic.core.system.errors import InputError
from ViTTransferFunction.Logic.refinement.guided_filter import BLOCKS, GuidedFilterSettings, guided_filter

UNIT_SPACING = (1.0, 1.0, 1.0)
BLOCKS_OF_ONE_VOXEL = GuidedFilterSettings(radius_mm=BLOCKS / 2, edge_luma=0.1)


def a_blurred_step(shape=(7, 8, 9)):
    """A blurred target, and a luma that steps where the target should."""
    along = torch.arange(shape[2]).expand(shape)
    noise = torch.randn(shape, generator=torch.Generator().manual_seed(0))
    return torch.sigmoid((along - shape[2] / 2.0) / 2.0), torch.where(along < shape[2] / 2, 0.3, 0.7) + 0.02 * noise


def guided_filter_by_definition(target, luma, epsilon):
    target, luma = target.double().numpy(), luma.double().numpy()
    reach = BLOCKS // 2

    def window(array, voxel):
        return array[tuple(slice(max(v - reach, 0), v + reach + 1) for v in voxel)]

    voxels = list(itertools.product(*map(range, target.shape)))
    a, b = np.empty(target.shape), np.empty(target.shape)
    for voxel in voxels:
        t, g = window(target, voxel), window(luma, voxel)
        a[voxel] = ((t * g).mean() - t.mean() * g.mean()) / (g.var() + epsilon)
        b[voxel] = t.mean() - a[voxel] * g.mean()
    means = np.array([(window(a, v).mean(), window(b, v).mean()) for v in voxels])
    filtered = means[:, 0].reshape(target.shape) * luma + means[:, 1].reshape(target.shape)
    return filtered.clip(target.min(), target.max())


def test_filter_fits_the_map_linearly_to_the_intensity_in_every_window():
    target, luma = a_blurred_step()
    expected = guided_filter_by_definition(target, luma, BLOCKS_OF_ONE_VOXEL.edge_luma**2)
    np.testing.assert_allclose(guided_filter(target, luma, UNIT_SPACING, BLOCKS_OF_ONE_VOXEL), expected, atol=1e-5)


def test_map_steps_where_the_image_does():
    target, luma = a_blurred_step((20, 20, 40))
    filtered = guided_filter(target, luma, UNIT_SPACING)
    step_before = float((target[..., 20] - target[..., 19]).mean())
    assert float((filtered[..., 20] - filtered[..., 19]).mean()) > 3 * step_before


@pytest.mark.parametrize("spacing_mm", [UNIT_SPACING, (5.0, 0.5, 0.5)])
def test_constant_map_stays_constant(spacing_mm):
    _, luma = a_blurred_step((11, 12, 13))
    np.testing.assert_allclose(guided_filter(torch.full(luma.shape, 0.3), luma, spacing_mm), 0.3, atol=1e-6)


def test_constant_volume_leaves_an_average():
    target, luma = a_blurred_step()
    filtered = guided_filter(target, torch.full_like(luma, 0.5), UNIT_SPACING, GuidedFilterSettings(radius_mm=1e9))
    np.testing.assert_allclose(filtered, float(target.mean()), atol=1e-5)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_voxels_without_intensity_keep_their_target_and_change_no_other(bad):
    target, luma = a_blurred_step()
    luma[3, 3, 3] = bad
    filtered = guided_filter(target, luma, UNIT_SPACING)
    assert float(filtered[3, 3, 3]) == float(target[3, 3, 3])
    target[3, 3, 3] = 0.5
    other = guided_filter(target, luma, UNIT_SPACING)
    other[3, 3, 3] = filtered[3, 3, 3]
    assert torch.equal(other, filtered)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_voxels_without_target_are_inferred(bad):
    target, luma = a_blurred_step()
    expected = guided_filter(target, luma, UNIT_SPACING)
    target[3, 3, 7] = bad
    np.testing.assert_allclose(guided_filter(target, luma, UNIT_SPACING), expected, atol=0.05)


@pytest.mark.parametrize("shape", [(1, 1, 1), (1, 8, 9), (7, 1, 1)])
def test_single_voxels_rows_and_slices_are_filtered(shape):
    target, luma = a_blurred_step(shape)
    filtered = guided_filter(target, luma, UNIT_SPACING)
    assert filtered.shape == shape
    assert float(filtered.min()) >= float(target.min())
    assert float(filtered.max()) <= float(target.max())


def test_target_and_luma_of_different_shapes_are_refused():
    with pytest.raises(InputError, match="expected the same three axes"):
        guided_filter(torch.zeros(3, 3, 3), torch.zeros(3, 3, 4), UNIT_SPACING)


def test_map_without_any_finite_voxel_is_refused():
    with pytest.raises(InputError, match="no voxel of the map is finite"):
        guided_filter(torch.full((3, 3, 3), torch.nan), torch.zeros(3, 3, 3), UNIT_SPACING)


@pytest.mark.parametrize("change", [{"radius_mm": 0.0}, {"edge_luma": float("nan")}])
def test_settings_that_cannot_be_used_are_refused(change):
    with pytest.raises(InputError, match="expected a finite number above 0"):
        GuidedFilterSettings(**change)
