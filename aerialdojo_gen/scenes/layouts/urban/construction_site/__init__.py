"""A construction site: an office tower's frame beside a deep pit, or a viaduct growing across a shallow valley."""
