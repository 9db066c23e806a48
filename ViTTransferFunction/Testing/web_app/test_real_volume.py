"""A session in the browser on a real CT with real features, from opening the file to reading what was downloaded."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("trame_slicer.core")
pytest.importorskip("psutil")

from ViTTransferFunction.Testing.support.masks import dice
from ViTTransferFunction.Testing.support.web_app import AppPage, change_near, changed_share, serving

LIVER = 5


class Labels:
    """Where organs are in the torso CT.

    Attributes:
        array: their labels, (K, J, I).
    """

    def __init__(self, path: Path) -> None:
        import SimpleITK as sitk  # noqa: N813

        # Axes to the left, back and up, as the axial view has them.
        self._image = sitk.DICOMOrient(sitk.ReadImage(str(path)), "LPS")
        self.array = sitk.GetArrayFromImage(self._image)

    def slice_mm(self, k: int) -> float:
        """Where a slice lies, upwards."""
        return float(self._image.TransformIndexToPhysicalPoint((0, 0, k))[2])

    def inmost(self, mask: np.ndarray) -> tuple[int, int]:
        """The pixel (j, i) of a slice's mask that is farthest from its border."""
        from scipy.ndimage import distance_transform_edt

        j, i = np.unravel_index(distance_transform_edt(np.pad(mask, 1))[1:-1, 1:-1].argmax(), mask.shape)
        return int(j), int(i)


def test_the_liver_of_a_ct_is_found_by_two_clicks_and_comes_home_as_a_file(
    new_page: Callable[[], AppPage], real_volume: Callable[[str], Path], real_weights: Path, tmp_path: Path
) -> None:
    import slicerio

    labels = Labels(real_volume("torso_small_labels.nii.gz"))
    options: list[str | Path] = ["--weights", real_weights, "--model", "dinov2_vits14_focus", "--grid", "20", "--device", "cpu"]
    with serving(real_volume("torso_small_ct.nii.gz"), *options, cache=tmp_path) as server:
        page = new_page()
        page.page.goto(server.address)
        page.wait_for_state("phase === 'no features' && opening === ''")
        page.wait_for_picture("Red", lambda picture: (picture.max(axis=2) > 60).mean() > 0.1)
        page.keep_picture("opened")
        page["extract"].click()
        page.wait_for_state("phase === 'extracting' && progress && progress.share > 0")
        page.keep_picture("computing features")
        page.wait_for_state("phase === 'ready'")

        k = int((labels.array == LIVER).sum(axis=(1, 2)).argmax())
        page["slice-Red"].fill(str(labels.slice_mm(k)))
        left, right, top, bottom = page.extent_in("Red")
        rows, columns = labels.array.shape[1:]

        def click_on(j: int, i: int) -> tuple[float, float]:
            pixel = left + (i + 0.5) / columns * (right - left), top + (j + 0.5) / rows * (bottom - top)
            page.click_in("Red", *pixel)
            return pixel

        page["add-class"].click()
        page["class-0"].wait_for()
        page["class-name-0"].fill("liver")
        page["class-name-0"].press("Enter")
        before, before_3d = page.picture("Red"), page.picture("ThreeD")
        pixel = click_on(*labels.inmost(labels.array[k] == LIVER))
        page.wait_for_state("classes[0].positive === 1 && up_to_date")
        positive = page.wait_for_picture("Red", lambda picture: change_near(before, picture, *pixel) > 15)
        page.wait_for_picture("ThreeD", lambda picture: changed_share(before_3d, picture) > 0.02)
        page.keep_picture("a point in the liver")

        page["tool-pointOff"].click()
        click_on(*labels.inmost((labels.array[k] != LIVER) & (labels.array[k] > 0)))
        page.wait_for_state("classes[0].negative === 1 && up_to_date")
        page.wait_for_picture("Red", lambda picture: changed_share(positive, picture) > 0.0005)
        page.keep_picture("a point beside it")
        page["refine"].uncheck()
        page.wait_for_state("up_to_date")
        page.keep_picture("not refined")
        page["refine"].check()
        page.wait_for_state("up_to_date")

        page["write-segments"].click()
        page.wait_for_state("written && progress === null")
        page.keep_picture("segments")
        with page.page.expect_download() as download:
            page["download-segmentation"].click()
        path = tmp_path / download.value.suggested_filename
        download.value.save_as(path)
        assert "Traceback" not in server.log()

    (segment,) = slicerio.read_segmentation(str(path))["segments"]
    assert segment["name"] == "liver"
    assert dice(Labels(path).array > 0, labels.array == LIVER) > 0.6
