"""An amusement park: a small fair on the terraces of a hillside, or a larger park about a lake."""
