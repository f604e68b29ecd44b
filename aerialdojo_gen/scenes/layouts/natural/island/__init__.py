"""An island: a tropical one with a volcano and a lagoon village, or a rocky northern islet with a fishing hamlet."""
