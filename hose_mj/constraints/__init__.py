"""When, where and why an episode breaks: signed margins of a world and the monitor of them."""
