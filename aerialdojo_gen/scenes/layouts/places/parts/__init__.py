"""What the layouts of real places share."""
