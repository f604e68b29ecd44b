"""One task for a person: its route drawn over orthographic pictures of its scene, as a PNG or a page."""
