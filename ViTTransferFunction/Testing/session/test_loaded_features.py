"""What is made of features and intensities is made once, for all who need it."""

from __future__ import annotations

import threading
from typing import Any

from ViTTransferFunction.Logic.session.loaded_features import LoadedFeatures, SharedIntensities
from ViTTransferFunction.Testing.support.patience import LONGEST_WAIT_S
from ViTTransferFunction.Testing.support.spheres import Spheres


def test_threads_that_need_the_rule_at_a_time_get_the_same_one() -> None:
    waited_for, made = threading.Event(), []

    def make_rule() -> Any:
        waited_for.wait(LONGEST_WAIT_S)
        made.append(object())
        return made[-1]

    loaded = LoadedFeatures(features=object(), make_rule=make_rule)  # type: ignore[arg-type]
    assert made == []
    got: list[Any] = []
    threads = [threading.Thread(target=lambda: got.append(loaded.rule)) for _ in range(4)]
    for thread in threads:
        thread.start()
    waited_for.set()
    for thread in threads:
        thread.join()
    assert got == 4 * made


def test_intensities_are_looked_at_anew_for_other_cells_alone(spheres: Spheres) -> None:
    volume, _ = spheres
    cells, others = (volume.geometry.resized((size, size, size)) for size in (8, 6))
    intensities = SharedIntensities(volume)
    first = intensities.on(cells)
    assert intensities.on(volume.geometry.resized((8, 8, 8))) is first
    assert intensities.on(others) is not first
    assert intensities.on(others).are_of(others)
