"""The release: what users load, its tables' contents and its dataset card."""
