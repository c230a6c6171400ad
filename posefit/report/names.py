"""Distinct names of methods and instances."""

from collections.abc import Iterable, Mapping, Sequence

from posefit.errors import printable


def distinct(
    names: Sequence[str], details: Iterable[Mapping[str, str]]
) -> tuple[str, ...]:
    """Return distinct names, printable on one line.

    If a name occurs several times, the details that differ follow in brackets:
    `sapso@pca (cooling 0.9)`. The setting `sapso.cooling` is shortened to `cooling` if
    no other differing setting has that name. If no detail differs, a number is added.

    Args:
        names: The names.
        details: The details of each by their names.

    Returns:
        The distinct names in the same order.
    """
    details = list(details)
    by_name: dict[str, list[Mapping[str, str]]] = {}
    for name, values in zip(names, details, strict=True):
        by_name.setdefault(name, []).append(values)
    differing = {name: _differing(several) for name, several in by_name.items()}
    longer: dict[str, None] = {}  # an ordered set
    for name, values in zip(names, details, strict=True):
        words = []
        for field, short in differing[name].items():
            if field in values:
                words.append(f"{short} {values[field]}")
        plain = printable(f"{name} ({', '.join(words)})" if words else name)
        unique = plain
        number = 1
        while unique in longer:
            number += 1
            unique = f"{plain} ({number})"
        longer[unique] = None
    return tuple(longer)


def _differing(several: Sequence[Mapping[str, str]]) -> dict[str, str]:
    """Return the fields whose values differ between the mappings, with short names."""
    fields: dict[str, None] = {}  # an ordered set
    # the mapping with the most fields decides their order
    for values in sorted(several, key=len, reverse=True):
        fields |= dict.fromkeys(values)
    differing = []
    for field in fields:
        if len({values.get(field) for values in several}) > 1:
            differing.append(field)
    short_names = [field.rpartition(".")[2] for field in differing]
    names = {}
    for field, short in zip(differing, short_names, strict=True):
        is_unique = short_names.count(short) == 1
        names[field] = short if is_unique else field
    return names
