"""The annotation tool: a local web page that people name landmarks and objects with, and choose their anchors."""
