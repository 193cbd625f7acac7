"""Case files and the studies made of them."""
