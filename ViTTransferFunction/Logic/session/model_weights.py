"""The weights of one model: those on this computer, or those to be downloaded."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path

from ..core.system.progress import Progress
from ..weights.models import PretrainedModel
from ..weights.sources import Trust, WeightsFile, WeightsUnavailable, find_weights
from ..weights.store import weights_folder
from .feature_estimate import WeightsDownload


class ModelWeights:
    """Finds a model's weights, and downloads them only if that is allowed.

    Args:
        model: the model.
        path: the user's own file or folder of weights; None: as `find_weights` finds them.
        trust: asked about downloaded weights whose hash nobody publishes (`find_weights`).
        ask_first: whether weights may be downloaded only if the last estimate announced the download, so that the user could be
            asked.
    """

    def __init__(self, model: PretrainedModel, path: str | Path | None, trust: Trust | None, ask_first: bool) -> None:
        self.model = model
        self._path = path
        self._trust = trust
        self._ask_first = ask_first
        self._may_download = not ask_first

    @cached_property
    def known(self) -> WeightsFile | None:
        """The weights if they are on this computer, else the published file to come; None if its hash is not published."""
        try:
            return find_weights(self.model.name, self._path, allow_download=False)
        except WeightsUnavailable:
            if self.model.sha256 is None:
                return None
            path = weights_folder() / self.model.file_name
            return WeightsFile(path, self.model.sha256, self.model, "not on this computer")

    @property
    def download(self) -> WeightsDownload | None:
        """The download of the weights; None if nobody publishes them as a file."""
        model = self.model
        if model.url is None:
            return None
        target = weights_folder() / model.file_name
        return WeightsDownload(model.name, model.licence, model.homepage, model.url, str(target), model.size_mb, model.sha256)

    def announced(self, download: WeightsDownload | None) -> None:
        """Note that an estimate announced this download, or none."""
        if self._ask_first:
            self._may_download = download is not None

    def get(self, progress: Progress) -> WeightsFile:
        """The weights, downloaded if they are not on this computer.

        Args:
            progress: called with bytes downloaded.

        Raises:
            InputError: the weights are not to be had, or a download was not announced.
            Cancelled: by the progress callback.
        """
        return find_weights(
            self.model.name, self._path, allow_download=self._may_download, trust=self._trust, progress=progress
        )
