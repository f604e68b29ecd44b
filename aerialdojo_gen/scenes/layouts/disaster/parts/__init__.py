"""What several types of this family share."""
