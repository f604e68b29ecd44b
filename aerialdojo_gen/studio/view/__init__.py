"""A scene in the browser: landmarks, objects, anchors and routes."""
