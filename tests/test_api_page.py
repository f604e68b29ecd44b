"""docs/api.md names what is public; its names are there and cheap. test_doc_blocks.py runs its blocks."""

import pytest

import aerialdojo_gen


def test_what_is_public_is_on_the_page_and_loaded_when_asked_for(project):
    text = (project / "docs/api.md").read_text(encoding="utf-8")
    for name in aerialdojo_gen.__all__:
        if name != "__version__":
            value = getattr(aerialdojo_gen, name)
            assert value.__name__ == name
            assert value.__doc__
            assert name in dir(aerialdojo_gen)
            assert f"`{name}`" in text or f"import {name}" in text or name in ("Release", "read_glb"), name
    with pytest.raises(AttributeError, match="no attribute 'open_relase'"):
        aerialdojo_gen.open_relase  # noqa: B018
