"""The block diagram of a graph: layout, shapes, and the formats they are written in."""
