"""What users load: building a release, its card, readers, statistics, and `validate`."""
