"""Whether a name is of one thing, of several, or of stuff, by plain rules, and what makes one thing of it."""

from __future__ import annotations

# Of one thing, though they end like plurals.
_SINGULAR = frozenset({"lens", "series", "species", "chaos", "cosmos", "news", "premises", "headquarters", "gallows"})
_SINGULAR_ENDS = ("ss", "us", "is", "as")
_PLURAL = frozenset({"people", "men", "women", "children", "cattle", "geese", "oxen", "sheep"})
_STUFF = {
    "a patch of": ("grass", "vegetation", "foliage", "ivy", "moss", "gravel", "sand", "snow", "soil", "mud"),
    "a heap of": ("debris", "rubble", "trash", "garbage", "rubbish", "junk", "firewood", "lumber", "scrap"),
    "a stretch of": ("water", "asphalt", "pavement", "paving", "terrain", "ground", "land", "ice"),
    "a set of": ("furniture", "equipment", "machinery", "scaffolding", "stairs", "steps"),
}  # fmt: skip
_GROUPS = {word: group for group, words in _STUFF.items() for word in words}


def group_of(name: str) -> str:
    """Say what makes one thing of a name."""
    word = name.lower().split()[-1] if name.split() else ""
    if word in _GROUPS:
        return _GROUPS[word]
    many = word.endswith("s") and len(word) > 3 and not word.endswith(_SINGULAR_ENDS) and word not in _SINGULAR
    return "a group of" if many or word in _PLURAL else ""
