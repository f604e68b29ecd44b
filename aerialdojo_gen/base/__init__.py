"""What all rooms use: errors, configuration, names, text, seeds, the paper's figures, clients of services."""
