"""The ways to refine a map, by name: for front ends, which offer them before anything that computes is loaded."""

from __future__ import annotations

from typing import Literal, get_args

RefinementMethod = Literal["bilateral", "guided", "none"]
REFINEMENT_METHODS: tuple[str, ...] = get_args(RefinementMethod)
