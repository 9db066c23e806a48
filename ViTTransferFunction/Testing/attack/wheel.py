"""Which attack a number stands for."""

from __future__ import annotations

import random

from ViTTransferFunction.Testing.attack import (
    annotation_attacks,
    cache_attacks,
    fault_attacks,
    option_attacks,
    picture_attacks,
    protocol_attacks,
    volume_attacks,
)
from ViTTransferFunction.Testing.attack.cases import Case, Maker, Place

SHARES: dict[Maker, int] = {
    volume_attacks.a_sound_volume: 6,
    volume_attacks.a_damaged_volume: 6,
    volume_attacks.a_header_that_lies: 10,
    volume_attacks.odd_values: 4,
    volume_attacks.an_odd_file: 4,
    volume_attacks.a_dicom_folder: 4,
    annotation_attacks.changed_annotations: 8,
    annotation_attacks.damaged_annotations: 3,
    annotation_attacks.many_points: 3,
    annotation_attacks.point_lists: 4,
    option_attacks.options: 8,
    option_attacks.windows: 2,
    option_attacks.colliding_outputs: 4,
    option_attacks.other_commands: 4,
    fault_attacks.a_quota: 4,
    fault_attacks.a_full_disk: 3,
    fault_attacks.a_folder_without_rights: 2,
    fault_attacks.a_console: 2,
    fault_attacks.a_signal: 6,
    fault_attacks.several_runs: 2,
    fault_attacks.the_same_again: 3,
    cache_attacks.changed_features: 6,
    cache_attacks.changed_weights: 5,
    protocol_attacks.changed_requests: 6,
    picture_attacks.pictures: 1,
    picture_attacks.views: 1,
}
"""How often each comes."""


def make_case(seed: int, number: int, place: Place) -> Case:
    """The case of this number; the same whenever it is made with the same seed."""
    wheel = [maker for maker, share in SHARES.items() for _ in range(share)]
    # Each stretch of numbers as long as the wheel has all kinds, in an order that does not favour the first.
    random.Random(0).shuffle(wheel)
    return wheel[number % len(wheel)](random.Random(f"{seed} {number}"), place)
