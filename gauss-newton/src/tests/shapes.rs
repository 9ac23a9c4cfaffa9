//! Laws of the distances between boxes.
