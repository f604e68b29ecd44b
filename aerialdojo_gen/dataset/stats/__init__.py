"""What a release holds, in tables and figures."""
