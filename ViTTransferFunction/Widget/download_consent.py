"""Before anything is downloaded, the user is told what it is and under which terms, and asked once."""

from __future__ import annotations

import slicer
from slicer.i18n import tr as _

from ViTTransferFunction.Logic.scene.feature_wording import download_question
from ViTTransferFunction.Logic.session.feature_estimate import WeightsDownload


class DownloadConsent:
    """Remembers what the user agreed to: a download that failed is tried again without another question."""

    def __init__(self) -> None:
        self._given: set[WeightsDownload] = set()

    def is_given(self, download: WeightsDownload) -> bool:
        """Whether the user agrees to a download, now or before."""
        if download not in self._given and slicer.util.confirmOkCancelDisplay(
            download_question(download), _("Download the weights?")
        ):
            self._given.add(download)
        return download in self._given
