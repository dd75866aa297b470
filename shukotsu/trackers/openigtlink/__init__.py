"""OpenIGTLink over TCP, as PLUS and 3D Slicer serve it: messages of tools' poses, and joining them."""
