"""A railway: a city station in a walled cutting with a goods yard, or a country station at a viaduct."""
