"""The robot as data: its file, its URDF, its joints and where its links are."""
