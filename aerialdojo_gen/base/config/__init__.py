"""The pipeline file and its sections: every key with its meaning, unit, default and bounds."""
