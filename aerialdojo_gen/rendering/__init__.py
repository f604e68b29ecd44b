"""PyBullet rendering, video and depth codecs, image checks."""
