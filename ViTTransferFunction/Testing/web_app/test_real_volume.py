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

LIVER, SPLEEN = 5, 1


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
        """The pixel (j, i) of a slice's mask that lies farthest from its border."""
        from scipy.ndimage import distance_transform_edt

        j, i = np.unravel_index(distance_transform_edt(np.pad(mask, 1))[1:-1, 1:-1].argmax(), mask.shape)
        return int(j), int(i)


def test_organs_of_a_ct_are_found_by_a_few_clicks_and_come_home_as_a_file(
    new_page: Callable[[], AppPage], real_volume: Callable[[str], Path], real_weights: Path, tmp_path: Path
) -> None:
    import slicerio

    labels = Labels(real_volume("torso_small_labels.nii.gz"))
    options = ["--weights", str(real_weights), "--model", "dinov2_vits14_focus", "--grid", "20", "--device", "cpu"]
    with serving(real_volume("torso_small_ct.nii.gz"), *options, cache=tmp_path) as server:
        page = new_page()
        page.page.goto(server.address)
        page.wait_for_state("phase === 'no features' && opening === ''")
        k = int(((labels.array == LIVER).sum(axis=(1, 2)) * ((labels.array == SPLEEN).sum(axis=(1, 2)) > 0)).argmax())
        page["slice-Red"].fill(str(labels.slice_mm(k)))
        left, right, top, bottom = page.extent_in("Red")
        rows, columns = labels.array.shape[1:]
        page.keep_picture("opened")

        page.click("extract")
        page.wait_for_state("phase === 'extracting' && progress && progress.share > 0")
        page.keep_picture("computing features")
        page.wait_for_state("phase === 'ready'")
        page.keep_picture("features")

        def click_on(label: int) -> tuple[float, float]:
            j, i = labels.inmost(labels.array[k] == label)
            pixel = left + (i + 0.5) / columns * (right - left), top + (j + 0.5) / rows * (bottom - top)
            page.click_in("Red", *pixel)
            return pixel

        page.click("add-class")
        page["class-0"].wait_for()
        page.rename(0, "liver")
        page.keep_picture("a structure")
        before, before_3d = page.picture("Red"), page.picture("ThreeD")
        pixel = click_on(LIVER)
        page.wait_for_state("classes[0].positive === 1 && up_to_date && !busy")
        positive = page.wait_for_picture("Red", lambda picture: change_near(before, picture, *pixel) > 15)
        page.wait_for_picture("ThreeD", lambda picture: changed_share(before_3d, picture) > 0.02)
        page.keep_picture("a point in the liver")

        page.click("tool-pointOff")
        page.keep_picture("the tool for points outside")
        click_on(SPLEEN)
        page.wait_for_state("classes[0].negative === 1 && up_to_date && !busy")
        negative = page.wait_for_picture("Red", lambda picture: changed_share(positive, picture) > 0.0005)
        page.keep_picture("a point outside the liver")
        page["refine"].uncheck()
        page.wait_for_state("!settings.refine && up_to_date && !busy")
        page.wait_for_picture("Red", lambda picture: changed_share(negative, picture) > 0.0005)
        page["refine"].check()
        page.wait_for_state("settings.refine && up_to_date && !busy")

        page.click("add-class")
        page["class-1"].wait_for()
        page.rename(1, "spleen")
        page.keep_picture("another structure")
        before, before_3d = page.picture("Red"), page.picture("ThreeD")
        pixel = click_on(SPLEEN)
        page.wait_for_state("classes[1].positive === 1 && up_to_date && !busy")
        page.wait_for_picture("Red", lambda picture: change_near(before, picture, *pixel) > 15)
        page.wait_for_picture("ThreeD", lambda picture: changed_share(before_3d, picture) > 0.01)
        page.keep_picture("a point in the spleen")

        # The file is what is wanted: the segments are made on the way.
        with page.page.expect_download(timeout=120_000) as download:
            page["download-segmentation"].click()
        page.wait_for_state("written && progress === null")
        page.keep_picture("segments")
        path = tmp_path / download.value.suggested_filename
        download.value.save_as(path)
        assert "Traceback" not in server.log()

    segmentation = slicerio.read_segmentation(str(path))
    values = {segment["name"]: segment["labelValue"] for segment in segmentation["segments"]}
    found = Labels(path).array
    assert dice(found == values["liver"], labels.array == LIVER) > 0.6
    assert dice(found == values["spleen"], labels.array == SPLEEN) > 0.6
