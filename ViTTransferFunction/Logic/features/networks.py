"""Networks ready to run: each opened, and its speed measured, once."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..weights.sources import WeightsFile
from .cost import NetworkSpeed, calibrate
from .device_check import UnsoundDevice, device_trouble
from .settings import FeatureSettings
from .vision_transformer import VisionTransformer

if TYPE_CHECKING:
    import torch


def open_network(weights: WeightsFile, device: torch.device) -> VisionTransformer:
    """The model on its device, ready to run. Raises InputError where the file holds no such model."""
    from ..weights.state_dict import load_state_dict

    return VisionTransformer(weights.model, load_state_dict(weights.path), weights.sha256, device)


class Networks:
    """The network that was opened last, and the speed of all that there were."""

    def __init__(self) -> None:
        self._opened: VisionTransformer | None = None
        self._speeds: dict[tuple[str, str, str], NetworkSpeed] = {}
        self._trouble: dict[tuple[str, torch.device], str] = {}

    def network(self, weights: WeightsFile, device: torch.device) -> VisionTransformer:
        """The model on its device; see `open_network`.

        Raises:
            UnsoundDevice: another device than the processor does not compute what the processor does.
        """
        network = self._opened
        wanted = (weights.model, weights.sha256, device)
        if network is None or (network.model, network.weights_digest, network.device) != wanted:
            # The one before goes first: both might be too much.
            self._opened = None
            network = open_network(weights, device)
            if device.type != "cpu":
                self._check_once(network)
            self._opened = network
        return network

    def _check_once(self, network: VisionTransformer) -> None:
        of = network.weights_digest, network.device
        if of not in self._trouble:
            self._trouble[of] = device_trouble(network)
        if self._trouble[of]:
            raise UnsoundDevice(self._trouble[of])

    def speed(self, network: VisionTransformer, settings: FeatureSettings) -> NetworkSpeed:
        """How fast the network is on its device, in the precision of the settings; a moment of work the first time."""
        key = (network.weights_digest, str(network.device), settings.on(network.device).precision)
        if key not in self._speeds:
            self._speeds[key] = calibrate(network, settings)
        return self._speeds[key]
