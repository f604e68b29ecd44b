"""Frames, angles, cameras and ray casting."""
