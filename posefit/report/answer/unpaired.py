"""What the gaps of a sweep cost: how many finished runs count in no comparison, and why."""


def unpaired_sentence(alone: int, spare: int, seeds: int, *, tested: bool) -> str:
    """Return how many finished runs are held against nothing or count in no mean; empty where there is none.

    `alone` runs have an instance and seed that some method has not finished. `spare` ones have been finished by all,
    but are beyond the `seeds` that every instance has, of which means are; tests count them where they are `tested`.
    """
    said = []
    if alone:
        has, them = ("run is", "it") if alone == 1 else ("runs are", "them")
        said.append(f"{alone} finished {has} left out of the comparison, as some method has no run to pair {them} with")
    if spare:
        where = "count in tests, but not in means and intervals" if tested else "count in no figure"
        each = "one seed" if seeds == 1 else f"{seeds} seeds"
        said.append(f"{spare} {'more ' if said else ''}{where}, which are of {each} of every instance")
    return "; ".join(said)
