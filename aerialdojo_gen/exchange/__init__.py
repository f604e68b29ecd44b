"""Task files in the formats of other benchmarks: written from the release, read into its tables."""
