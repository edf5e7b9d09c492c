"""People before a camera: skins, shapes, and pictures of them. No display and no GPU."""
