"""A railway: a country station at a viaduct."""
