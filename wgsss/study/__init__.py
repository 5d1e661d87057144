"""What is measured of materials and methods, side by side."""
