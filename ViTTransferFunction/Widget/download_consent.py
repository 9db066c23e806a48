"""Before anything is downloaded, the user is told what it is and under which terms, and asked once."""

from __future__ import annotations

from urllib.parse import urlsplit

import slicer
from slicer.i18n import tr as _

from ViTTransferFunction.Logic.session.feature_estimate import WeightsDownload
from ViTTransferFunction.Widget.wording import size


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


def download_question(download: WeightsDownload) -> str:
    """What there is to know about weights before they are downloaded."""
    return _(
        "To compute features, this module needs the weights of a neural network, which are not on this computer yet.\n\n"
        "Model: {model} ({homepage})\n"
        "Licence: {licence}\n"
        "Download: {size}, once, from {site}\n"
        "Kept as: {target}\n"
        "SHA-256: {sha256}\n\n"
        "Nothing is uploaded: your images stay on this computer. Without a network, press Cancel, get the file on another "
        "computer from {url}, and choose it under Advanced, Weights.\n\n"
        "For research use only. This is not a medical device: do not base diagnosis or treatment on its results."
    ).format(
        model=download.model,
        homepage=download.homepage,
        licence=download.licence,
        size=size(download.size_mb * 1e6),
        site=urlsplit(download.url).hostname,
        target=download.target,
        sha256=download.sha256 or _("not published; the file that comes is trusted, and no other from then on"),
        url=download.url,
    )
