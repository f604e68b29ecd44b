"""A task as a PNG or a page: its route drawn over orthographic pictures of the scene."""
