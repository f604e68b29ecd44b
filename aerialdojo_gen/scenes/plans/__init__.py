"""Plans: scenes as data. A plan is a TOML file; the kit's builders make what it says."""
