"""A slice of the generated cases; `python dev.py attack` runs as many as wanted."""

from __future__ import annotations

import pytest

from ViTTransferFunction.Testing.attack.attack import attack
from ViTTransferFunction.Testing.attack.forked_calls import ForkedCalls

SEED, CASES = 0, 300


@pytest.mark.slow
@pytest.mark.parametrize("number", range(CASES))
def test_whatever_is_given_a_run_is_done_or_refused_in_a_sentence_and_all_else_is_as_it_was(
    forked: ForkedCalls, number: int
) -> None:
    verdict = attack(forked, SEED, number)
    assert not verdict.failures, (
        f"{verdict.failures}\n{verdict.story}\nAgain: python dev.py attack --seed {SEED} --first {number} --cases 1"
    )
