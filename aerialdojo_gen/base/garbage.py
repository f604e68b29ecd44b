"""How often a process of ours looks for garbage."""

import gc


def collect_rarely() -> None:
    """Look after 50,000 new objects, not 700: imports and catalogues make many objects, and hardly any garbage."""
    gc.set_threshold(50_000, 20, 20)
