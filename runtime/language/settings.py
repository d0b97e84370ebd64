"""Parameters with a structure of their own: ``neuron: {type: LIF, ...}``, ``uniform(200, 400)``.

In: a block's class and a path of keys. Out: the declaration at its end. For ("neuron", "tau_rc")
the class is that of the model which the mapping names, or of the default if it names none.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from blocks.core import Block, Param, Variant
from runtime.language.items import YamlItem
from runtime.language.offers import Offer, escape_snippet

_CALL = re.compile(r"\w+\([\w\s,.\[\]]*\)")
_ARGUMENT = re.compile(r"[A-Za-z_][\w ]*")


def param_at(cls: type[Block] | None, keys: Sequence[str], holder: YamlItem | None) -> Param | None:
    """The declaration of a parameter, or of one inside a setting.

    Parameters
    ----------
    keys : of the parameter in the block, and then of each setting around it and its own.
    holder : the mapping that the last key is in.
    """
    param = cls.spec.params.get(keys[0]) if cls is not None else None
    for depth, key in enumerate(keys[1:], 1):
        # The class depends on the mapping that is written around each level, so it is looked up
        # from outside inwards.
        inside = variant_at(param, _above(holder, len(keys) - 1 - depth))
        param = inside.declared.get(key) if inside is not None else None
    return param


def variant_at(param: Param | None, mapping: YamlItem | None) -> type[Variant] | None:
    """The class of the setting that is written in a mapping; the default's, if none is named."""
    root = root_of(param)
    if root is None or param is None:
        return None
    type_item = mapping.get(root.key) if mapping is not None else None
    if type_item is not None:
        return root.members.get(type_item.value)
    default = param.default
    return root.members.get(default) if isinstance(default, str) else None


def root_of(param: Param | None) -> type[Variant] | None:
    """The family of settings that a parameter takes one of, if it is such a parameter."""
    setting = param.setting if param is not None else None
    return setting if setting is not None and issubclass(setting, Variant) else None


def forms_of(param: Param, in_flow: bool) -> Iterator[Offer]:
    """What may be written for a setting: names, calls with places for their arguments, mappings."""
    if param.setting is None:
        return
    for form, doc in param.setting.forms().items():
        name, _, _ = form.partition("(")
        # A rule such as exp(cos(2*pi*(i - j)/n)) is an example, with no places to fill in.
        if not _CALL.fullmatch(form):
            yield Offer(form, "value", doc, rank=0)
            continue
        # In braces, a comma would end the value: uniform(200, 400) needs quotes there.
        quote = "'" if in_flow and "," in form else ""
        yield Offer(form, "snippet", doc, "", f"{quote}{_with_places(form, name)}{quote}", True, 0)
    root = root_of(param)
    for label, member in root.members.items() if root is not None else ():
        if root is not None and member.declared:
            places, numbers = [], iter(range(1, 20))
            for name, each in member.declared.items():
                if not each.required:
                    continue
                # An array begins with two numbers: enough for most, such as a denominator.
                place = [f"${{{next(numbers)}:number}}" for _ in range(1 + (each.kind == "array"))]
                value = place[0] if each.kind != "array" else f"[{', '.join(place)}]"
                places.append(f"{name}: {value}")
            text = f"{{{root.key}: {label}, {', '.join(places) or '$1'}}}"
            label = f"{{{root.key}: {label}, ...}}"
            yield Offer(label, "snippet", ", ".join(member.declared), "", text, True, 1)


def _with_places(form: str, name: str) -> str:
    """A call as a snippet whose arguments are filled in one after the other."""
    numbers = iter(range(1, 20))
    arguments = form.removeprefix(name).replace(", ...", "")
    places = _ARGUMENT.sub(lambda found: f"${{{next(numbers)}:{found[0]}}}", arguments)
    return escape_snippet(name) + places


def _above(item: YamlItem | None, levels: int) -> YamlItem | None:
    """The mapping so many levels around another."""
    for _ in range(levels):
        item = item.parent if item is not None else None
    return item
