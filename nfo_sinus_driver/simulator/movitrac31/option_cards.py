# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The option cards of a MOVITRAC 31.., as the drive tells of them [M4 §1]."""

from __future__ import annotations

from collections.abc import Mapping

#: What stands for "none" in a place for a card.
_NONE = 9
#: The cards, by the half-bytes of the places X20 and X21 (indices 237 and 284).
_PLACES: Mapping[str, tuple[int, int]] = {
    'none': (_NONE, _NONE),
    'fea': (1, _NONE),
    'fio': (5, _NONE),
    'ffi': (2, _NONE),
    'ffp': (2, _NONE),
    'fen': (_NONE, 1),
    'fpi': (_NONE, 3),
    # the manual has parameters for it, and lists no number in either place
    'frs': (_NONE, _NONE),
}
CARDS = tuple(_PLACES)


def places(card: str) -> tuple[int, int]:
    """Return what the drive tells of the places X20 and X21."""
    return _PLACES[card]


def suffices(card: str, needed: str) -> bool:
    """
    Tell whether a parameter is there with a card.

    :param needed: the cards of which it needs one, as the tables name them; empty: none.
    """
    return not needed or card.upper() in needed.split(' or ')
