"""The panel beside the pictures, made of Dear ImGui controls that read and change a `Session`.

A panel is declared anew for each frame: the call that declares a control also returns the value that the user has set.
"""
