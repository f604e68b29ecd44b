"""Mountains: ridges and peaks in benches of rock, a stream with boulders, switchback paths, a hut, alpine meadows."""
