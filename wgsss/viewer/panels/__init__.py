"""The panel beside the pictures: Dear ImGui controls that read and change a `Session`."""
