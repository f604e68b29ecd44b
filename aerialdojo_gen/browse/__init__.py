"""Looking things up in a release."""
