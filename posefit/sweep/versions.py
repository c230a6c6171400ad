"""The versions in a cell: which libraries are installed, and which versions differ."""

from functools import lru_cache

from posefit.version import posefit_build


def foreign_plugins(version: str) -> str:
    """Return the part of a cell's version that is about plugins from elsewhere."""
    origins = installed()
    return ", ".join(part for part in version.split(", ") if not origins.get(part))


def other_version(origin: str) -> str | None:
    """Return the installed version of a library if it differs from the planned one.

    Args:
        origin: The library's name and its planned version, one part of a cell's
            version.

    Returns:
        The origin of the installed version, or None if it is the same or the library is
        not installed.
    """
    name = origin.partition(" ")[0]
    origins = installed()
    if origin in origins:
        return None
    for other in origins:
        if other.partition(" ")[0] == name:
            return other
    return None


@lru_cache(maxsize=1)
def installed() -> dict[str, bool]:
    """Return the origins of posefit and all plugins, and whether each is posefit's own.

    See `posefit.registry.Offer.origin`.
    """
    from posefit.hooks import PROJECT
    from posefit.registry import registry

    origins = {posefit_build(): True}
    for named in registry().offers.values():
        for offer in named.values():
            origins[offer.origin] = offer.distribution == PROJECT
    return origins
