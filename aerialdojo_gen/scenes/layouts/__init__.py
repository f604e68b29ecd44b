"""Layouts, one a scene type: how such a place is built, drawing from the catalogue.

A type is a folder of a family's folder, ``<family>/<type>/``, with a module `layout`; plans, buildings and tables of
coordinates that it alone uses stand beside it. What several types of a family share is in the family's ``parts/``,
what several families share in ``parts/`` here.
"""

from __future__ import annotations

from pathlib import Path


def layout_modules() -> dict[str, str]:
    """Find the layouts.

    Returns
    -------
    dict of str to str
        By the type's name, as recipes say it: ``{"town": "places.town.layout"}``, relative to this package.

    Raises
    ------
    RuntimeError
        Two families have a type of the same name.
    """
    found: dict[str, str] = {}
    for root in __path__:
        for path in sorted(Path(root).glob("*/*/layout.py")):
            family, name = path.parts[-3:-1]
            if name in found:
                raise RuntimeError(f"layout {name!r} stands twice: {found[name]} and {family}.{name}.layout")
            found[name] = f"{family}.{name}.layout"
    return found
