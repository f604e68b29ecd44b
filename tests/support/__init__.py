"""What tests share: hand-made scenes and tables, servers, browsers, faults."""
