"""Completion: what may be written at an offset, what fits best first.

In: a model and an offset. Out: offers, and the span that they replace. At "blocks: {u: {type:
Const|" the first is "Constant", in place of "Const". Offers come from ``keys`` or ``values``; here
they are filtered and sorted.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from runtime.language.cursor import Cursor, cursor_at
from runtime.language.keys import keys_at
from runtime.language.model import Model
from runtime.language.offers import Offer, matches
from runtime.language.text import Span
from runtime.language.values import values_at

MAX_OFFERED = 300


@dataclass(frozen=True)
class Completion:
    """The offers at an offset, the best first, and what they replace; ``is_complete`` says whether
    more would match."""

    offers: tuple[Offer, ...]
    span: Span
    is_complete: bool = True


def complete(model: Model, offset: int) -> Completion:
    """What may be written at an offset."""
    cursor = cursor_at(model.text, model.root, offset)
    if cursor is None:
        return Completion((), Span(offset, offset))
    other_keys = {each.key for each in cursor.holder.items if each is not cursor.item}
    if cursor.role == "key":
        candidates = (offer for offer in keys_at(model, cursor) if offer.label not in other_keys)
        offers = [_as_key(offer, cursor) for offer in candidates]
    else:
        offers = [_as_value(offer, cursor) for offer in values_at(model, cursor)]
    matching = [o for o in offers if o.label and matches(cursor.prefix, o.label)]
    # The sort is stable: within a rank, declarations keep the order in which their authors wrote
    # them.
    matching.sort(key=lambda offer: (offer.rank, not offer.label.startswith(cursor.prefix)))
    best = tuple(matching[:MAX_OFFERED])
    return Completion(best, cursor.span, len(best) == len(matching))


def _as_key(offer: Offer, cursor: Cursor) -> Offer:
    """A key with its colon, unless one is written."""
    has_colon = cursor.item is not None and cursor.item.colon >= 0
    if offer.is_snippet or has_colon:
        return offer
    return replace(offer, insert=f"{offer.text}: ")


def _as_value(offer: Offer, cursor: Cursor) -> Offer:
    return replace(offer, insert=cursor.lead + offer.text) if cursor.lead else offer
