"""What all parts use and none owns: parsing with bounds, random draws, the paper's numbers, the machine's limits."""
