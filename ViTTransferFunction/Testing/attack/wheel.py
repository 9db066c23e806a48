"""Which attack a number stands for."""

from __future__ import annotations

import random

from ViTTransferFunction.Testing.attack import volume_attacks
from ViTTransferFunction.Testing.attack.cases import Case, Maker, Place

SHARES: dict[Maker, int] = {
    volume_attacks.a_sound_volume: 6,
    volume_attacks.a_damaged_volume: 6,
    volume_attacks.a_header_that_lies: 10,
    volume_attacks.odd_values: 4,
    volume_attacks.an_odd_file: 4,
    volume_attacks.a_dicom_folder: 3,
}
"""How often each comes."""


def make_case(seed: int, number: int, place: Place) -> Case:
    """The case of this number; the same whenever it is made with the same seed."""
    wheel = [maker for maker, share in SHARES.items() for _ in range(share)]
    # Each stretch of numbers as long as the wheel has all kinds, in an order that does not favour the first.
    random.Random(0).shuffle(wheel)
    return wheel[number % len(wheel)](random.Random(f"{seed} {number}"), place)
